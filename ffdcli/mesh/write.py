"""Write triangles as a mesh file: whole or not at all.

trimesh writes all formats but OBJ, whose groups it would take apart into bodies of their own. STL,
PLY and GLB hold single precision; how far that moves vertices is told, not hidden.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.errors import FileError
from ffdcli.files import write_whole
from ffdcli.formats import MESH_FORMATS, mesh_format
from ffdcli.mesh.record import Floats, Ints

_SINGLE_PRECISION = ("STL", "PLY", "GLB")
# The names that 3MF has for units; it has no others.
_3MF_UNITS = {
    "um": "micron",
    "mm": "millimeter",
    "cm": "centimeter",
    "m": "meter",
    "inch": "inch",
    "ft": "foot",
}
_3MF_MODEL = "3D/3dmodel.model"
_UUID = re.compile(rb' p:UUID="[^"]*"')


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
    """

    bytes: int
    rounding: float
    collapsed: int


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


def write_mesh(
    path: str | Path,
    vertices: Floats,
    triangles: Ints,
    *,
    groups: Mapping[str, Ints] | None = None,
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
        Triangles of each named group; OBJ, GLB and 3MF keep the names.
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
    label, names = _label(len(triangles), groups or {})
    content: bytes
    if kind == "OBJ":
        content = _as_obj(vertices, triangles, label, names)
    elif kind in ("GLB", "3MF"):
        # Names are part of the files: two must not be alike.
        parts = _titles([" ".join(row) or name for row in names])
        content = _as_scene(vertices, triangles, label, parts, kind)
        if kind == "3MF":
            content = _settle_3mf(content, _3MF_UNITS[unit])
    elif kind is not None:
        content = _as_one(vertices, triangles, kind)
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
    )


def _label(count: int, groups: Mapping[str, Ints]) -> tuple[Ints, list[list[str]]]:
    """(count,) label of each triangle, and the names that each label stands for."""
    member = np.zeros((count, len(groups)), dtype=bool)
    for column, rows in enumerate(groups.values()):
        member[rows, column] = True
    if not groups:
        return np.zeros(count, dtype=np.int64), [[]]
    patterns, label = np.unique(member, axis=0, return_inverse=True)
    known = list(groups)
    return label.reshape(-1), [[known[i] for i in np.flatnonzero(row)] for row in patterns]


def _titles(titles: list[str]) -> list[str]:
    """The same, made different where two are alike."""
    counts: dict[str, int] = {}
    out = []
    for title in titles:
        counts[title] = counts.get(title, 0) + 1
        out.append(title if counts[title] == 1 else f"{title} {counts[title]}")
    return out


def _as_obj(vertices: Floats, triangles: Ints, label: Ints, names: list[list[str]]) -> bytes:
    """Vertices once for all groups, with all their digits."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    # Triangles of no group come first, before any name.
    for number, row in enumerate(names):
        if row:
            lines.append(" ".join(["g", *("_".join(word.split()) for word in row)]))
        corners = (triangles[label == number] + 1).tolist()
        lines += [f"f {a} {b} {c}" for a, b, c in corners]
    return ("\n".join(lines) + "\n").encode()


def _as_one(vertices: Floats, triangles: Ints, kind: str) -> bytes:
    """All triangles as one body: STL, PLY and OFF."""
    import trimesh

    options: Any = {"digits": _decimals(vertices)} if kind == "OFF" else {}
    body: Any = trimesh.Trimesh(vertices, triangles, process=False)
    content = body.export(file_type=kind.lower(), **options)
    return content.encode() if isinstance(content, str) else bytes(content)


def _as_scene(
    vertices: Floats, triangles: Ints, label: Ints, titles: list[str], kind: str
) -> bytes:
    """A named body for each group: GLB and 3MF."""
    import trimesh

    scene: Any = trimesh.Scene()
    for number, title in enumerate(titles):
        used, corners = np.unique(triangles[label == number], return_inverse=True)
        body = trimesh.Trimesh(vertices[used], corners.reshape(-1, 3), process=False)
        scene.add_geometry(body, node_name=title, geom_name=title)
    return bytes(scene.export(file_type=kind.lower()))


def _decimals(vertices: Floats) -> int:
    """Decimals that give back every bit of the largest coordinate."""
    largest = float(np.abs(vertices).max(initial=0.0))
    return 17 if largest == 0 else int(np.clip(16 - np.floor(np.log10(largest)), 0, 300))


def _settle_3mf(content: bytes, unit: str) -> bytes:
    """State the unit, which trimesh does not, and leave out what differs from run to run."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for item in old.infolist():
            data = old.read(item)
            if item.filename == _3MF_MODEL:
                data = data.replace(b'unit="millimeter"', f'unit="{unit}"'.encode(), 1)
                data = _UUID.sub(b"", data)
            entry = zipfile.ZipInfo(item.filename, (1980, 1, 1, 0, 0, 0))
            new.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _count_collapsed(stored: Floats, triangles: Ints) -> int:
    """Triangles two of whose corners are in one place."""
    corner = stored[triangles]
    same = (corner == np.roll(corner, -1, axis=1)).all(axis=2)
    return int(np.count_nonzero(same.any(axis=1)))
