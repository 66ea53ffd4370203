"""Read a mesh file into the `Mesh` record: the only place that knows trimesh.

Nothing is changed silently. Vertices are welded only at open edges, and only where their
coordinates are the same to the last bit; polygons are kept where the format has them, and what was
left out or split is noted.
"""

from __future__ import annotations

import re
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError, MeshError
from ffdcli.labels import Labels
from ffdcli.mesh.io.materials import read_libraries
from ffdcli.mesh.io.ply import parse_ply
from ffdcli.mesh.io.scene_labels import scene_labels, stated_name
from ffdcli.mesh.io.scene_texture import join_uv, part_uv, stored_uv
from ffdcli.mesh.io.text import (
    TextPolygons,
    count_decimals,
    parse_obj,
    parse_off,
    parse_stl,
)
from ffdcli.mesh.io.texture import settle
from ffdcli.mesh.polygons import split_bent
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.repair import repair as mend
from ffdcli.mesh.soundness.weld import weld_equal
from ffdcli.messages import counted, place_text

# Formats trimesh reads by itself. Those it hands on to meshio lose every quad without a word.
FORMATS = ("obj", "stl", "ply", "off", "glb", "gltf", "3mf", "dae", "zae", "3dxml", "xaml")

# Digits coarser than this part of the size say how somebody likes to write numbers (0, 1, 0.5),
# not how well the coordinates are known: such numbers are taken as exact.
COARSEST_DIGIT = 1e-5

# Coordinates beyond this are no lengths.
LARGEST_COORDINATE = 1e50

_UNITS = {
    name: short
    for short, names in {
        "um": ("micron", "microns", "micrometer", "micrometers"),
        "mm": ("millimeter", "millimeters"),
        "cm": ("centimeter", "centimeters"),
        "m": ("meter", "meters"),
        "inch": ("inch", "inches"),
        "ft": ("foot", "feet"),
    }.items()
    for name in names
}
_3MF_COORDINATE = re.compile(rb"<(?:\w+:)?vertex\s([^>]*)>")
_ATTRIBUTE = re.compile(rb"\b[xyz]\s*=\s*[\"']\s*([^\"'\s]+)")


@dataclass(frozen=True)
class _Polygons:
    """Polygons as the file has them: nothing checked, welded or dropped yet."""

    vertices: Floats
    corners: Ints
    starts: Ints
    resolution: float
    unit: str | None = None
    notes: tuple[str, ...] = ()
    groups: Mapping[str, Ints] = field(default_factory=dict)
    labels: Labels | None = None
    # Texture coordinates (C, 2) of the corners, not finite where there are none.
    uv: Floats | None = None
    # Part of the file that each vertex belongs to, where it has several.
    part: Ints | None = None


def read_mesh(path: str | Path, *, repair: bool = False) -> Mesh:
    """Read a polygon mesh: all bodies of the file, in world coordinates.

    Parameters
    ----------
    path : str or Path
        OBJ, STL, PLY, OFF, GLB, glTF, 3MF or another of `FORMATS`, told by its extension.
    repair : bool
        Mend what can be mended without moving the surface: see `ffdcli.mesh.soundness.repair`.

    Returns
    -------
    Mesh
        Coordinates in float64, bit-identical vertices at open edges welded, vertices without a
        polygon dropped, polygons that are not flat within ``Mesh.delta`` split into triangles (see
        its `notes`).

    Raises
    ------
    FileError
        The file is missing, not a file, of an unknown format, unreadable or cut short.
    MeshError
        No polygons, a coordinate that is not finite, or a corner without a vertex.
    """
    path = Path(path)
    source = str(path)
    extension = path.suffix.lower().lstrip(".")
    data = _read_bytes(path, extension)
    if extension == "obj":
        polygons = _from_obj(parse_obj(data, source), path.parent)
    elif extension == "off":
        polygons = _from_text(parse_off(data, source))
    elif extension == "ply":
        polygons = _from_ply(data, source)
    elif extension == "stl" and not _is_binary_stl(data):
        polygons = _from_text(parse_stl(data, source))
    else:
        polygons = _from_trimesh(path, extension, data)
    mesh = _settle(polygons, source)
    return mend(mesh)[0] if repair else mesh


def _read_bytes(path: Path, extension: str) -> bytes:
    source = str(path)
    if extension not in FORMATS:
        said = f"'.{extension}' is not a mesh format known here" if extension else "no extension"
        raise FileError(
            f"cannot tell the mesh format: {said}",
            file=source,
            hint="use one of: " + ", ".join("." + name for name in FORMATS),
        )
    if not path.exists():
        raise FileError("there is no such file", file=source, hint="check the path")
    if not path.is_file():
        raise FileError("this is a folder, not a file", file=source, hint="name the mesh file")
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(
            f"the file cannot be read: {error.strerror}", file=source, hint="check its permissions"
        ) from error


def _is_binary_stl(data: bytes) -> bool:
    """Whether the length is what the binary header promises (text may begin with anything)."""
    return len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _from_text(text: TextPolygons) -> _Polygons:
    resolution = _text_resolution(text.vertices, text.decimals)
    return _Polygons(text.vertices, text.corners, text.starts, resolution, uv=text.uv)


def _from_obj(text: TextPolygons, folder: Path) -> _Polygons:
    """The polygons with their names, and what the files of materials say of these."""
    labels, notes = text.labels, list[str]()
    if labels is not None and labels.materials:
        found, notes = read_libraries(folder, text.libraries)
        painted = (found.get(each.name, each) for each in labels.materials)
        labels = replace(labels, materials=tuple(painted))
    polygons = _from_text(text)
    return replace(polygons, groups=text.groups, labels=labels, notes=tuple(notes))


def _from_trimesh(path: Path, extension: str, data: bytes) -> _Polygons:
    """All meshes of the scene that trimesh makes of the file, with their transforms applied."""
    scene = _load_scene(path)
    import trimesh

    vertices, corners, counts = [np.empty((0, 3))], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    places: list[Floats | None] = []
    stored = stored_uv(list(scene.geometry), path, data)
    resolution, offset, stretch, notes = 0.0, 0, 0.0, []
    polygon, groups = 0, dict[str, Ints]()
    nodes: list[tuple[str, str, int]] = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            continue
        if geometry.metadata.get("processed"):
            notes.append("the reader of this format welded vertices closer than 1e-8")
        faces = np.asarray(geometry.faces)
        part = _from_faces(np.asarray(geometry.vertices), faces)
        part = replace(part, uv=part_uv(geometry, faces, stored.get(name)))
        part = _transformed(part, np.asarray(transform, dtype=np.float64))
        stretch = max(stretch, float(np.linalg.norm(transform[:3, :3], 2)))
        vertices.append(part.vertices)
        corners.append(part.corners + offset)
        counts.append(np.diff(part.starts))
        places.append(part.uv)
        stated, count = stated_name(scene, str(node)), len(part.starts) - 1
        group = stated or str(node)
        groups[group] = np.r_[groups.get(group, corners[0]), polygon + np.arange(count)]
        polygon += count
        nodes.append((stated, str(name), count))
        resolution = max(resolution, part.resolution)
        offset += len(part.vertices)
    joined = np.concatenate(vertices)
    if extension == "3mf":
        decimals, textured = _facts_of_3mf(path)
        resolution = _text_resolution(joined, decimals, stretch)
        notes += ["texture coordinates of 3MF files are left out"] if textured else []
    return _Polygons(
        joined,
        np.concatenate(corners),
        np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int64),
        resolution,
        _UNITS.get((scene.units or "").lower()),
        tuple(dict.fromkeys(notes)),
        # One nameless part is no group.
        groups if len(groups) > 1 else {},
        scene_labels(nodes, list(scene.geometry), path, data),
        join_uv(places, [3 * count for _, _, count in nodes]),
        np.repeat(np.arange(len(vertices)), [len(each) for each in vertices]),
    )


def _load_scene(path: Path) -> Any:
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return trimesh.load_scene(
                str(path), process=False, maintain_order=True, skip_materials=True
            )
    except Exception as error:  # whatever a broken file makes of a third-party reader
        raise FileError(
            f"the file cannot be read as {path.suffix.lower()}: {_first_line(error)}",
            file=str(path),
            hint="export it again, as triangles or in another format such as .obj",
        ) from error


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _from_faces(vertices: Floats, faces: Ints) -> _Polygons:
    single = np.array_equal(vertices, vertices.astype(np.float32), equal_nan=True)
    return _Polygons(
        vertices.astype(np.float64),
        faces.astype(np.int64).ravel(),
        np.arange(0, 3 * len(faces) + 1, 3),
        _binary_resolution(vertices, np.float32 if single else np.float64),
    )


def _from_ply(data: bytes, source: str) -> _Polygons:
    found = parse_ply(data, source)
    resolution = _binary_resolution(found.vertices, np.float64 if found.double else np.float32)
    if found.decimals is not None:
        resolution = max(resolution, _text_resolution(found.vertices, found.decimals))
    return _Polygons(found.vertices, found.corners, found.starts, resolution, uv=found.uv)


def _facts_of_3mf(path: Path) -> tuple[int, bool]:
    """Most decimals of any coordinate, and whether there are texture coordinates."""
    with zipfile.ZipFile(path) as archive:
        models = [name for name in archive.namelist() if name.lower().endswith(".model")]
        texts = [archive.read(name) for name in models]
    tags = [tag for text in texts for tag in _3MF_COORDINATE.findall(text)]
    decimals = count_decimals(np.array(_ATTRIBUTE.findall(b" ".join(tags)) or [b"0"]))
    return decimals, any(b"tex2coord" in text for text in texts)


def _transformed(part: _Polygons, transform: Floats) -> _Polygons:
    """World coordinates; a mirrored part is turned the right way out again."""
    if np.array_equal(transform, np.eye(4)):
        return part
    linear = transform[:3, :3]
    corners, uv = part.corners, part.uv
    if np.linalg.det(linear) < 0:
        last = np.repeat(part.starts[:-1] + part.starts[1:] - 1, np.diff(part.starts))
        reverse = last - np.arange(len(corners))
        corners, uv = corners[reverse], None if uv is None else uv[reverse]
    # Errors of 0 * nan are reported with the vertex that caused them, later.
    with np.errstate(invalid="ignore"):
        vertices = part.vertices @ linear.T + transform[:3, 3]
    resolution = max(
        part.resolution * float(np.linalg.norm(linear, 2)), _binary_resolution(vertices, np.float64)
    )
    return _Polygons(vertices, corners, part.starts, resolution, uv=uv)


def _binary_resolution(vertices: Floats, kind: type[np.floating[Any]]) -> float:
    """Four units in the last place of `kind` at the largest coordinate."""
    largest = np.abs(vertices[np.isfinite(vertices)]).max(initial=0.0)
    return 4 * float(np.spacing(kind(largest)))


def _text_resolution(vertices: Floats, decimals: int, stretch: float = 1.0) -> float:
    """Half the last printed digit, where that says something; never below four ulp."""
    exact = _binary_resolution(vertices, np.float64)
    if not len(vertices) or not np.isfinite(vertices).all():
        return exact
    half_digit = 0.5 * 10.0**-decimals * stretch
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return max(exact, half_digit) if half_digit <= COARSEST_DIGIT * size else exact


def _settle(polygons: _Polygons, source: str) -> Mesh:
    """Check, weld, drop stray vertices, split what is not flat."""
    _require_sound(polygons, source)
    notes = list(polygons.notes)
    used = np.zeros(len(polygons.vertices), dtype=bool)
    used[polygons.corners] = True
    stray = int(np.count_nonzero(~used))
    if stray:
        what = counted(stray, "vertex", "vertices") + " without a polygon left out, the first at"
        notes.append(f"{what} {place_text(polygons.vertices[np.argmin(used)])}")
    uv = None
    if polygons.uv is not None:
        uv, lost = settle(polygons.uv, polygons.starts)
        notes += [lost] if lost else []
    target = weld_equal(polygons.vertices, polygons.corners, polygons.starts, polygons.part)
    kept, corners = np.unique(target[polygons.corners], return_inverse=True)
    mesh = Mesh(
        polygons.vertices[kept] + 0.0,  # -0.0 becomes 0.0
        corners.astype(np.int64),
        polygons.starts,
        polygons.resolution,
        polygons.unit,
        source,
        tuple(notes),
        polygons.groups,
        polygons.labels,
        uv,
    )
    return split_bent(mesh)


def _require_sound(polygons: _Polygons, source: str) -> None:
    counts = np.diff(polygons.starts)
    if not len(counts):
        raise MeshError(
            "the file holds no polygons that can be read",
            file=source,
            hint="export a surface mesh, not points or curves",
        )
    # Of larger numbers areas and volumes are no longer finite.
    wrong = np.flatnonzero(~(np.abs(polygons.vertices) <= LARGEST_COORDINATE).all(axis=1))
    if len(wrong):
        raise MeshError(
            f"vertex {wrong[0]} (counted from 0) has a coordinate that is no number or beyond "
            f"{LARGEST_COORDINATE:g}; {len(wrong)} such vertices in all",
            file=source,
            hint="delete or mend them in a mesh editor",
        )
    beyond = (polygons.corners < 0) | (polygons.corners >= len(polygons.vertices))
    if beyond.any():
        corner = int(np.argmax(beyond))
        polygon = int(np.searchsorted(polygons.starts, corner, side="right")) - 1
        raise MeshError(
            f"polygon {polygon} (counted from 0) refers to a vertex that is not there: "
            f"the file has {len(polygons.vertices)}",
            file=source,
            hint="export the mesh again",
        )
    used = polygons.vertices[polygons.corners]
    if len(used) and not np.ptp(used, axis=0).any():
        raise MeshError(
            f"all polygons lie in one point, {place_text(used[0])}",
            file=source,
            hint="export the mesh again",
        )
    few = np.flatnonzero(counts < 3)
    if len(few):
        raise MeshError(
            f"polygon {few[0]} (counted from 0) has only {counts[few[0]]} corners; "
            f"{len(few)} such polygons in all",
            file=source,
            hint="delete them in a mesh editor",
        )
