"""Write triangles as a mesh file: whole or not at all.

trimesh writes STL, PLY, OFF and GLB. STL, PLY and GLB hold single precision; how far that moves
vertices is told, not hidden.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.files import write_whole
from ffdcli.formats import MESH_FORMATS, mesh_format
from ffdcli.labels import Colour
from ffdcli.mesh.io.paint import Paint, distinct
from ffdcli.mesh.io.write_3mf import as_3mf
from ffdcli.mesh.io.write_obj import as_mtl, as_obj

_SINGLE_PRECISION = ("STL", "PLY", "GLB")
# Formats that have names of groups, colours, and texture coordinates.
NAMED = ("OBJ", "GLB", "3MF")
COLOURED = ("OBJ", "PLY", "GLB", "3MF")
TEXTURED = ("OBJ", "PLY", "GLB")
# The names that 3MF has for units; it has no others.
_3MF_UNITS = {
    "um": "micron",
    "mm": "millimeter",
    "cm": "centimeter",
    "m": "meter",
    "inch": "inch",
    "ft": "foot",
}


@dataclass(frozen=True)
class Written:
    """What became of the triangles.

    Parameters
    ----------
    bytes : int
    rounding : float, model length
        How far at most the format's numbers move a vertex.
    collapsed : int
        Triangles two of whose corners become one place.
    unnamed : tuple of str
        Groups that the format has no place for.
    """

    bytes: int
    rounding: float
    collapsed: int
    unnamed: tuple[str, ...] = ()


def require_mesh_unit(path: str | Path, unit: str) -> None:
    """Refuse a unit that the format states, but has no name for.

    Raises
    ------
    FileError
    """
    if mesh_format(path) == "3MF" and unit not in _3MF_UNITS:
        raise FileError(
            f"3MF files cannot be in the unit {unit!r}",
            file=str(path),
            hint=f"use {', '.join(_3MF_UNITS)}, or another format",
        )


def kept_by(path: str | Path) -> list[Literal["names", "texture"]]:
    """Which of names and texture coordinates the format of a file has a place for."""
    kind = mesh_format(path)
    names: list[Literal["names", "texture"]] = ["names"] if kind in NAMED else []
    return [*names, "texture"] if kind in TEXTURED else names


def write_mesh(
    path: str | Path,
    vertices: Floats,
    triangles: Ints,
    *,
    groups: Mapping[str, Ints] | None = None,
    paint: Paint | None = None,
    uv: Floats | None = None,
    name: str = "mesh",
    unit: str = "mm",
) -> Written:
    """Write a triangle mesh by its extension, whole or not at all.

    Parameters
    ----------
    path : str or Path
        ``.stl``, ``.obj``, ``.ply``, ``.off``, ``.glb`` or ``.3mf``.
    vertices : (V, 3) float64, model length
        Written as they are; the unit is stated by 3MF alone.
    triangles : (T, 3) int64
    groups : mapping of str to (n,) int64, optional
        Triangles of each named group; OBJ and GLB keep the names, 3MF those of whole bodies.
    paint : Paint, optional
        OBJ (with a file of materials beside it), GLB and 3MF keep materials and their colours, PLY
        the colours.
    uv : (T, 3, 2) float64, optional
        Texture coordinates of the triangles' corners, NaN for triangles that have none; OBJ, PLY
        and GLB keep them. The latter two have one for each vertex, so that vertices at seams become
        several.
    name : str
        Of the triangles that are in no group.
    unit : str

    Raises
    ------
    FileError
        An unknown extension or unit, or the file cannot be written.
    """
    kind = mesh_format(path)
    require_mesh_unit(path, unit)
    paint = paint or Paint((), np.full(len(triangles), -1))
    parted = paint if kind != "3MF" else Paint((), np.full(len(triangles), -1))
    label, names, material = _label(len(triangles), groups or {}, parted)
    if kind == "3MF":
        # By its standard an object is closed: parts of a body cannot be objects of their own.
        label, names = _whole_bodies(triangles, label, names)
    # Names are part of some files: two must not be alike.
    parts = distinct([" ".join(row) or name for row in names])
    content: bytes
    if kind == "OBJ":
        library = Path(path).with_suffix(".mtl") if paint.materials else None
        content = as_obj(vertices, triangles, uv, label, names, paint, material, library)
        if library is not None:
            write_whole(library, as_mtl(paint, library.parent))
    elif kind == "GLB":
        content = _as_glb(vertices, triangles, uv, label, parts, paint, material)
    elif kind == "3MF":
        content = as_3mf(vertices, triangles, label, parts, paint, _3MF_UNITS[unit])
    elif kind is not None:
        content = _as_one(vertices, triangles, uv, paint, kind)
    else:
        raise FileError(
            f"cannot write a mesh of kind {Path(path).suffix or 'without an extension'!r}",
            file=str(path),
            hint=f"use one of {', '.join(MESH_FORMATS)}",
        )
    stored = vertices
    if kind in _SINGLE_PRECISION:
        stored = vertices.astype(np.float32).astype(np.float64)
    write_whole(path, content)
    return Written(
        bytes=len(content),
        rounding=float(np.linalg.norm(stored - vertices, axis=1).max(initial=0.0)),
        collapsed=_count_collapsed(stored, triangles),
        unnamed=tuple(sorted(set(groups or {}).difference(*names))) if kind == "3MF" else (),
    )


def _label(
    count: int, groups: Mapping[str, Ints], paint: Paint
) -> tuple[Ints, list[list[str]], list[int]]:
    """(count,) label of each triangle; the names, and the material, that each label stands for."""
    pattern = np.zeros((count, len(groups) + 1), dtype=np.int64)
    # Triangles without a material come first: in OBJ there is no way back to none.
    pattern[:, 0] = paint.material
    for column, rows in enumerate(groups.values()):
        pattern[rows, 1 + column] = 1
    patterns, label = np.unique(pattern, axis=0, return_inverse=True)
    known = list(groups)
    names = [[known[i] for i in np.flatnonzero(row[1:])] for row in patterns]
    return label.reshape(-1), names, patterns[:, 0].tolist()


def _whole_bodies(
    triangles: Ints, label: Ints, names: list[list[str]]
) -> tuple[Ints, list[list[str]]]:
    """One label for all triangles that hang together by edges, with the names that all have."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    # Labels and edges are the nodes; sharing an edge is two steps.
    size = len(names) + len(ends)
    links = (np.repeat(label, 3), len(names) + edge.ravel())
    graph = coo_array((np.ones(len(ends), dtype=np.int8), links), shape=(size, size))
    _, part = np.unique(
        connected_components(graph, directed=False)[1][: len(names)], return_inverse=True
    )
    whole = []
    for number in range(part.max(initial=-1) + 1):
        first, *others = [set(names[row]) for row in np.flatnonzero(part == number)]
        whole.append(sorted(first.intersection(*others)))
    return part[label], whole


def _as_one(vertices: Floats, triangles: Ints, uv: Floats | None, paint: Paint, kind: str) -> bytes:
    """All triangles as one body: STL, PLY and OFF."""
    import trimesh

    options: Any = {"digits": _decimals(vertices)} if kind == "OFF" else {}
    attributes: dict[str, Any] = {}
    if kind == "PLY" and uv is not None:
        used, triangles, places = _parted_at_seams(triangles, uv)
        vertices, attributes = vertices[used], {"s": places[:, 0], "t": places[:, 1]}
    body: Any = trimesh.Trimesh(
        vertices, triangles, process=False, vertex_attributes=attributes or None
    )
    if kind == "PLY" and paint.coloured:
        body.visual.face_colors = paint.face_colours()
    content = body.export(file_type=kind.lower(), **options)
    return content.encode() if isinstance(content, str) else bytes(content)


def _parted_at_seams(triangles: Ints, uv: Floats) -> tuple[Ints, Ints, Floats]:
    """Vertices with one place in the texture each.

    Returns
    -------
    (n,) int64
        The vertex that each new one is.
    (T, 3) int64
        Triangles of the new ones.
    (n, 2) float64
        Their texture coordinates; 0 where there are none.
    """
    rows = np.column_stack([triangles.ravel(), np.nan_to_num(uv.reshape(-1, 2))])
    found, place = np.unique(rows, axis=0, return_inverse=True)
    return found[:, 0].astype(np.int64), place.reshape(-1, 3), found[:, 1:]


def _as_glb(
    vertices: Floats,
    triangles: Ints,
    uv: Floats | None,
    label: Ints,
    titles: list[str],
    paint: Paint,
    material: list[int],
) -> bytes:
    """A named body for each group and material."""
    import trimesh

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    for number, title in enumerate(titles):
        chosen, places = label == number, None
        if uv is None or np.isnan(uv[chosen]).all():
            used, corners = np.unique(triangles[chosen], return_inverse=True)
        else:
            used, corners, places = _parted_at_seams(triangles[chosen], uv[chosen])
        body: Any = trimesh.Trimesh(vertices[used], corners.reshape(-1, 3), process=False)
        look: Any = None
        if material[number] >= 0:
            known = paint.materials[material[number]]
            colour = None if known.colour is None else [*_linear(known.colour), 1.0]
            look = visual.material.PBRMaterial(name=known.name, baseColorFactor=colour)
        elif places is not None:
            # The writer has no texture coordinates without a material.
            look = visual.material.PBRMaterial()
        if look is not None:
            body.visual = visual.TextureVisuals(uv=places, material=look)
        scene.add_geometry(body, node_name=title, geom_name=title)
    return bytes(scene.export(file_type="glb"))


def _linear(colour: Colour) -> list[float]:
    """glTF has colours in linear light (IEC 61966-2-1)."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]


def _decimals(vertices: Floats) -> int:
    """Decimals that give back every bit of the largest coordinate."""
    largest = float(np.abs(vertices).max(initial=0.0))
    return 17 if largest == 0 else int(np.clip(16 - np.floor(np.log10(largest)), 0, 300))


def _count_collapsed(stored: Floats, triangles: Ints) -> int:
    """Triangles two of whose corners are in one place."""
    corner = stored[triangles]
    same = (corner == np.roll(corner, -1, axis=1)).all(axis=2)
    return int(np.count_nonzero(same.any(axis=1)))
