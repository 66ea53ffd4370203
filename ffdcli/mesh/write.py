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
from ffdcli.labels import Colour, Material
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


@dataclass(frozen=True)
class Paint:
    """Materials of triangles.

    Parameters
    ----------
    materials : tuple of Material
    material : (T,) int64
        Position of each triangle's in ``materials``; -1 for none.
    """

    materials: tuple[Material, ...]
    material: Ints

    @property
    def names(self) -> list[str]:
        """A name for each material, of one word, none like another."""
        words = ["_".join(each.name.split()) for each in self.materials]
        return [w.replace(" ", "_") for w in _titles([word or "material" for word in words])]

    @property
    def coloured(self) -> bool:
        """Whether any material has a colour."""
        return any(each.colour is not None for each in self.materials)

    def face_colours(self) -> Ints:
        """(T, 4) red, green, blue and opacity of triangles, 0 to 255; grey for those without."""
        grey = (0.7, 0.7, 0.7)
        table = [each.colour or grey for each in self.materials] + [grey]
        levels = np.round(255 * np.array(table)[self.material]).astype(np.uint8)
        return np.column_stack([levels, np.full(len(levels), 255, dtype=np.uint8)])


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
    paint: Paint | None = None,
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
    paint : Paint, optional
        OBJ (with a file of materials beside it) and GLB keep materials and their colours, PLY the
        colours.
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
    label, names, material = _label(len(triangles), groups or {}, paint)
    content: bytes
    if kind == "OBJ":
        library = Path(path).with_suffix(".mtl") if paint.materials else None
        content = _as_obj(vertices, triangles, label, names, paint, material, library)
        if library is not None:
            write_whole(library, _as_mtl(paint))
    elif kind in ("GLB", "3MF"):
        # Names are part of the files: two must not be alike.
        parts = _titles([" ".join(row) or name for row in names])
        content = _as_scene(vertices, triangles, label, parts, paint, material, kind)
        if kind == "3MF":
            content = _settle_3mf(content, _3MF_UNITS[unit])
    elif kind is not None:
        content = _as_one(vertices, triangles, paint, kind)
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


def _titles(titles: list[str]) -> list[str]:
    """The same, made different where two are alike."""
    counts: dict[str, int] = {}
    out = []
    for title in titles:
        counts[title] = counts.get(title, 0) + 1
        out.append(title if counts[title] == 1 else f"{title} {counts[title]}")
    return out


def _as_obj(
    vertices: Floats,
    triangles: Ints,
    label: Ints,
    names: list[list[str]],
    paint: Paint,
    material: list[int],
    library: Path | None,
) -> bytes:
    """Vertices once for all groups, with all their digits."""
    lines = [] if library is None else [f"mtllib {library.name}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    # Names and materials hold until the next.
    grouped, used = False, -1
    for number, row in enumerate(names):
        if row or grouped:
            lines.append(" ".join(["g", *("_".join(word.split()) for word in row)]))
            grouped = True
        if material[number] != used and material[number] >= 0:
            used = material[number]
            lines.append(f"usemtl {paint.names[used]}")
        corners = (triangles[label == number] + 1).tolist()
        lines += [f"f {a} {b} {c}" for a, b, c in corners]
    return ("\n".join(lines) + "\n").encode()


def _as_mtl(paint: Paint) -> bytes:
    """The materials of an OBJ file."""
    lines = []
    for name, material in zip(paint.names, paint.materials, strict=True):
        lines.append(f"newmtl {name}")
        if material.colour is not None:
            lines.append("Kd " + " ".join(map(repr, map(float, material.colour))))
    return ("\n".join(lines) + "\n").encode()


def _as_one(vertices: Floats, triangles: Ints, paint: Paint, kind: str) -> bytes:
    """All triangles as one body: STL, PLY and OFF."""
    import trimesh

    options: Any = {"digits": _decimals(vertices)} if kind == "OFF" else {}
    body: Any = trimesh.Trimesh(vertices, triangles, process=False)
    if kind == "PLY" and paint.coloured:
        body.visual.face_colors = paint.face_colours()
    content = body.export(file_type=kind.lower(), **options)
    return content.encode() if isinstance(content, str) else bytes(content)


def _as_scene(
    vertices: Floats,
    triangles: Ints,
    label: Ints,
    titles: list[str],
    paint: Paint,
    material: list[int],
    kind: str,
) -> bytes:
    """A named body for each group and material: GLB and 3MF."""
    import trimesh

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    for number, title in enumerate(titles):
        used, corners = np.unique(triangles[label == number], return_inverse=True)
        body: Any = trimesh.Trimesh(vertices[used], corners.reshape(-1, 3), process=False)
        if kind == "GLB" and material[number] >= 0:
            chosen = paint.materials[material[number]]
            colour = None if chosen.colour is None else [*_linear(chosen.colour), 1.0]
            look = visual.material.PBRMaterial(name=chosen.name, baseColorFactor=colour)
            body.visual = visual.TextureVisuals(material=look)
        scene.add_geometry(body, node_name=title, geom_name=title)
    return bytes(scene.export(file_type=kind.lower()))


def _linear(colour: Colour) -> list[float]:
    """glTF has colours in linear light (IEC 61966-2-1)."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]


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
