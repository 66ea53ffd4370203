"""Files that trimesh reads or writes: scenes of placed parts, joined to one mesh."""

from __future__ import annotations

import math
import re
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.mesh.io.placed_parts import PlacedPart, join_parts
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution
from ffdcli.mesh.io.xml_scenes.count import count_scene
from ffdcli.units import UNITS, unit_in_words

# How trimesh states the unit of a COLLADA file that is not the metre.
_METRES = re.compile(r"([0-9.e+-]+) \* meters")
_LONGEST_UNIT = 40


def decode_scene(data: bytes, path: Path) -> RawMesh:
    """All meshes of a file in a format that only trimesh knows, in world coordinates.

    Raises
    ------
    FileError
        trimesh cannot read the file, returns less or more than it holds, or its meshes are in
        several units.
    """
    import trimesh

    if path.suffix.lower() in (".dae", ".zae") and find_spec("collada") is None:
        raise FileError(
            "COLLADA files need the package pycollada",
            file=str(path),
            hint="pip install 'ffdcli[dae]', or export another format such as .obj",
        )
    promised = count_scene(data, path)
    scene = _load_scene(path)
    parts: list[PlacedPart] = []
    notes, units = dict.fromkeys(promised.notes), set[str]()
    for number, node in enumerate(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            notes["parts without triangles are left out"] = None
            continue
        if geometry.metadata.get("processed"):
            notes["the reader of this format welded vertices closer than 1e-8"] = None
        units.add(str(geometry.units or ""))
        vertices = np.asarray(geometry.vertices, dtype=np.float64)
        uv = getattr(geometry.visual, "uv", None)
        if uv is not None and (len(uv) != len(vertices) or np.shape(uv)[1:] < (2,)):
            uv = None
        single = np.array_equal(vertices, vertices.astype(np.float32), equal_nan=True)
        parts.append(
            PlacedPart(
                number,
                str(node),
                vertices,
                np.asarray(geometry.faces, dtype=np.int64),
                binary_resolution(vertices, np.float32 if single else np.float64),
                np.asarray(transform, dtype=np.float64)[None],
                uv=None if uv is None else np.asarray(uv, dtype=np.float64)[:, :2],
            )
        )
    promised.require(sum(len(part.triangles) for part in parts), len(parts), path)
    unit, unknown = _unit(units, path)
    return join_parts(parts, path, materials=None, unit=unit, notes=(*notes, *unknown))


def _load_scene(path: Path) -> Any:
    """The scene that trimesh makes of a file, without materials."""
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return trimesh.load_scene(
                str(path), process=False, maintain_order=True, skip_materials=True
            )
    except Exception as error:  # a broken file can raise anything in a third-party reader
        first_line = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise FileError(
            f"the file cannot be read as {path.suffix.lower()}: {first_line}",
            file=str(path),
            hint="export it again, as triangles or in another format such as .obj",
        ) from error


def _unit(stated: set[str], path: Path) -> tuple[str | None, tuple[str, ...]]:
    """The unit of all meshes, and a note on one that is not known; "" for a mesh without one."""
    units = {text: unit_in_words(text) or _unit_of_metres(text) for text in stated}
    if len({unit or text for text, unit in units.items()}) > 1:
        raise FileError(
            f"its parts are in several units: {', '.join(repr(u[:_LONGEST_UNIT]) for u in units)}",
            file=str(path),
            hint="export it in one unit, or the parts of each unit by themselves",
        )
    unknown = [text for text, unit in units.items() if text and unit is None]
    note = "the unit {!r} that the file states is not known here: it is left out"
    return next(iter(units.values()), None), tuple(note.format(u[:_LONGEST_UNIT]) for u in unknown)


def _unit_of_metres(text: str) -> str | None:
    """The unit of so many metres, rounded as files have it."""
    found = _METRES.fullmatch(text.strip().lower())
    try:
        millimetres = 1000 * float(found[1]) if found else math.nan
    except ValueError:
        return None
    return next(
        (u.name for u in UNITS if math.isclose(u.millimetres, millimetres, rel_tol=1e-6)), None
    )


def export_body(
    vertices: Floats,
    triangles: Ints,
    kind: str,
    *,
    vertex_attributes: dict[str, Any] | None = None,
    face_colours: Ints | None = None,
    **options: Any,
) -> bytes:
    """All triangles as one body, encoded by trimesh as ``kind``: "stl", "ply" or "off"."""
    import trimesh

    body: Any = trimesh.Trimesh(
        vertices, triangles, process=False, vertex_attributes=vertex_attributes
    )
    if face_colours is not None:
        body.visual.face_colors = face_colours
    content = body.export(file_type=kind, **options)
    return content.encode() if isinstance(content, str) else bytes(content)
