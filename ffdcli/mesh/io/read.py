"""Read a mesh file by its extension, check it, and weld it.

Nothing is changed silently. Vertices are welded only at open edges, and only if their coordinates
are identical; polygons are kept as the format has them; what is left out or split is noted.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints, run_numbers
from ffdcli.errors import FileError, MeshError
from ffdcli.files import read_file
from ffdcli.labels import LONGEST_NAME, plain_names
from ffdcli.mesh.io.raw_mesh import RawMesh
from ffdcli.mesh.polygons import split_bent
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.repair import repair as mend
from ffdcli.mesh.soundness.weld import weld_equal
from ffdcli.messages import counted, place_text

# Module and function of each format; only the one that is needed is loaded.
DECODERS = {
    ".obj": ("obj", "decode_obj"),
    ".stl": ("stl", "decode_stl"),
    ".ply": ("ply", "decode_ply"),
    ".off": ("off", "decode_off"),
    ".glb": ("gltf.read", "decode_gltf"),
    ".gltf": ("gltf.read", "decode_gltf"),
    ".3mf": ("threemf.read", "decode_3mf"),
    # trimesh reads these by itself. Formats that it passes to meshio lose every quad.
    **dict.fromkeys((".dae", ".zae", ".3dxml", ".xaml"), ("scenes", "decode_scene")),
}

# Areas and volumes of larger coordinates overflow.
LARGEST_COORDINATE = 1e50


def read_mesh(path: str | Path, *, repair: bool = False) -> Mesh:
    """Read a polygon mesh: all bodies of the file, in world coordinates.

    Parameters
    ----------
    path : str or Path
        OBJ, STL, PLY, OFF, GLB, glTF, 3MF or another format of trimesh; the extension decides.
    repair : bool
        Repair what can be repaired without moving the surface: see
        `ffdcli.mesh.soundness.repair`.

    Returns
    -------
    Mesh
        Coordinates in float64, identical vertices at open edges welded, vertices without a polygon
        dropped, polygons that are not flat within ``Mesh.delta`` split into triangles (see its
        `notes`).

    Raises
    ------
    FileError
        The file is missing, not a file, of an unknown format, unreadable or cut short.
    MeshError
        No polygons, a coordinate that is not finite, or a corner without a vertex.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in DECODERS:
        what = f"{suffix!r} is not a mesh format known here" if suffix else "no extension"
        raise FileError(
            f"cannot tell the mesh format: {what}",
            file=str(path),
            hint=f"use one of: {', '.join(DECODERS)}",
        )
    mesh = _settle(decoder(suffix)(read_file(path), path), str(path))
    return mend(mesh)[0] if repair else mesh


def decoder(suffix: str) -> Callable[[bytes, Path], RawMesh]:
    """The function that reads the bytes of a file with this extension."""
    module, name = DECODERS[suffix]
    found: Callable[[bytes, Path], RawMesh] = getattr(
        importlib.import_module(f"ffdcli.mesh.io.{module}"), name
    )
    return found


def _settle(raw: RawMesh, source: str) -> Mesh:
    """Check the polygons, weld, drop unused vertices, and split polygons that are not flat."""
    _require_polygons(raw, source)
    raw = _with_plain_names(raw)
    notes = list(raw.notes)
    used = np.zeros(len(raw.vertices), dtype=bool)
    used[raw.corners] = True
    stray = int(np.count_nonzero(~used))
    if stray:
        what = counted(stray, "vertex", "vertices") + " without a polygon left out, the first at"
        notes.append(f"{what} {place_text(raw.vertices[np.argmin(used)])}")
    uv = None
    if raw.uv is not None:
        uv, partial = _complete_texture(raw.uv, raw.starts)
        if partial:
            what = counted(partial, "polygon is", "polygons are")
            notes.append(f"texture coordinates of {what} not complete: they are left out")
    target = weld_equal(raw.vertices, raw.corners, raw.starts, raw.part)
    kept, corners = np.unique(target[raw.corners], return_inverse=True)
    mesh = Mesh(
        raw.vertices[kept] + 0.0,  # -0.0 becomes 0.0
        corners.astype(np.int64),
        raw.starts,
        raw.resolution,
        raw.unit,
        source,
        tuple(notes),
        raw.groups,
        raw.labels,
        uv,
    )
    return split_bent(mesh)


def _with_plain_names(raw: RawMesh) -> RawMesh:
    """The mesh with names that every format can hold; a note says how many that changes."""
    labels = raw.labels
    names = [*raw.groups]
    if labels is not None:
        names += [*labels.bodies, *labels.groups, *(each.name for each in labels.materials)]
    new = plain_names(names)
    if not new:
        return raw
    if labels is not None:
        labels = replace(
            labels,
            bodies=tuple(new.get(name, name) for name in labels.bodies),
            groups=tuple(new.get(name, name) for name in labels.groups),
            materials=tuple(
                replace(each, name=new.get(each.name, each.name)) for each in labels.materials
            ),
        )
    groups = {new.get(name, name): polygons for name, polygons in raw.groups.items()}
    which = counted(len(new), "name is", "names are")
    note = (
        f"{which} changed: control characters become spaces,"
        f" and what is longer than {LONGEST_NAME} characters is cut"
    )
    return replace(raw, groups=groups, labels=labels, notes=(*raw.notes, note))


def _complete_texture(uv: Floats, starts: Ints) -> tuple[Floats | None, int]:
    """Texture coordinates (C, 2) of the polygons that have them at all corners, NaN for others.

    None if there are only others; and the number of polygons that had them at some corners.
    """
    found = np.isfinite(uv).all(axis=1)
    having = np.add.reduceat(found, starts[:-1], dtype=np.int64)
    counts = np.diff(starts)
    complete = having == counts
    kept = np.where(np.repeat(complete, counts)[:, None], uv, np.nan) if complete.any() else None
    return kept, int(np.count_nonzero(~complete & (having > 0)))


def _require_polygons(raw: RawMesh, source: str) -> None:
    """Reject polygons that are no polygons, and coordinates that are no lengths."""
    counts = np.diff(raw.starts)
    if not len(counts):
        raise MeshError(
            "the file holds no polygons that can be read",
            file=source,
            hint="export a surface mesh, not points or curves",
        )
    beyond = (raw.corners < 0) | (raw.corners >= len(raw.vertices))
    if beyond.any():
        polygon = run_numbers(raw.starts)[np.argmax(beyond)]
        raise MeshError(
            f"polygon {polygon} (counted from 0) refers to a vertex that does not exist: "
            f"the file has {len(raw.vertices)}",
            file=source,
            hint="export the mesh again",
        )
    used = raw.vertices[raw.corners]
    wrong = np.flatnonzero(~(np.abs(used) <= LARGEST_COORDINATE).all(axis=1))
    if len(wrong):
        vertices = raw.corners[wrong]
        raise MeshError(
            f"vertex {vertices[0]} of polygon {run_numbers(raw.starts)[wrong[0]]} (counted from 0) "
            f"has a coordinate that is not a number or beyond {LARGEST_COORDINATE:g}; "
            f"{len(np.unique(vertices))} such vertices in all",
            file=source,
            hint="delete or correct them in a mesh editor",
        )
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
