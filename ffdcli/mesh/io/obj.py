"""OBJ files with their materials, decoded and encoded."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints, run_numbers, run_starts
from ffdcli.errors import FileError
from ffdcli.files import fault_of, read_file
from ffdcli.labels import Labels, Material, number_names
from ffdcli.mesh.io.painted_mesh import EncodedMesh, Paint, PaintedMesh, obj_word, split_parts
from ffdcli.mesh.io.raw_mesh import RawMesh, text_resolution
from ffdcli.mesh.io.text_numbers import (
    parse_colour,
    parse_coordinates,
    parse_indices,
    plain_lines,
)
from ffdcli.messages import counted

_STATEMENT = re.compile(rb"^[ \t]*(vt|[vfgo]|usemtl|mtllib)(?=[ \t]|$)[ \t]*(.*)$", re.MULTILINE)
_NAMING = rb"^([ \t]*(?:[go]|usemtl|mtllib)[ \t][^\n]*)$"
# Names may hold the comment mark: `_name_in` removes the comments of their statements.
_COMMENT = re.compile(_NAMING + rb"|#[^\n]*", re.MULTILINE)
# Names may end in a backslash too: only other statements go on in the next line.
_CONTINUED = re.compile(_NAMING + rb"|\\[ \t]*(?:\n|\Z)", re.MULTILINE)
# All lines but those that are read, or that say nothing about the surface: normals, smoothing,
# display.
_OTHER = re.compile(
    rb"^[ \t]*(?!(?:v[tn]?|[vfgos]|mg|usemtl|mtllib|usemap|maplib|bevel|lod|[cd]_interp|shadow_obj"
    rb"|trace_obj)(?:[ \t]|$))([^\s]+)",
    re.MULTILINE,
)
# Kinds of them that a note names.
_MOST_KINDS = 8
# Statements of material files (.mtl).
_MATERIAL = re.compile(rb"^[ \t]*(newmtl|Kd|map_Kd)[ \t]+([^\n]*)", re.MULTILINE)
# Polygons times the most groups of any: a few kilobytes could ask for gigabytes.
MOST_MEMBERS = 20_000_000
# Kind and rest of a statement, in the order of the file.
_Statements = list[tuple[bytes, bytes]]


def decode_obj(data: bytes, path: Path) -> RawMesh:
    """Faces with texture coordinates, groups, objects as bodies, and materials.

    Raises
    ------
    FileError
        A coordinate or an index cannot be read.
    """
    source = str(path)
    text = _COMMENT.sub(rb"\1", plain_lines(data))
    if b"\\" in text:
        text = _CONTINUED.sub(lambda found: found[1] or b" ", text)
    statements: _Statements = _STATEMENT.findall(text)
    vertices, decimals = parse_coordinates(
        [rest.split(None, 3)[:3] for kind, rest in statements if kind == b"v"], source
    )
    faces = [rest.split() for kind, rest in statements if kind == b"f"]
    tokens = list(chain.from_iterable(faces))
    corners = parse_indices([token.partition(b"/")[0] for token in tokens], source)
    starts = run_starts(np.array([len(face) for face in faces], dtype=np.int64))
    if np.any(corners == 0):
        polygon = run_numbers(starts)[np.argmax(corners == 0)]
        raise FileError(
            f"polygon {polygon} (counted from 0) refers to vertex 0, but OBJ counts from 1",
            file=source,
            hint="export the mesh again",
        )
    corners = _from_zero(corners, b"v", statements, starts)
    coordinates = [rest.split()[:2] for kind, rest in statements if kind == b"vt"]
    uv = None
    if coordinates:
        places = _texture_indices(tokens)
        uv = _texture(coordinates, _from_zero(places, b"vt", statements, starts))
    resolution = text_resolution(vertices, decimals)
    mesh = RawMesh(vertices, corners, starts, resolution, notes=_left_out(text), uv=uv)
    return _with_names(mesh, statements, path.parent)


def _left_out(text: bytes) -> tuple[str, ...]:
    """A note on the lines that are not read, by their first word; none if there are none."""
    counts = Counter(_OTHER.findall(text))
    if not counts:
        return ()
    most = counts.most_common(_MOST_KINDS)
    kinds = [f"{n} {word[:20].decode(errors='replace')}" for word, n in most]
    if len(counts) > len(most):
        kinds.append("others")
    what = counted(counts.total(), "line that is", "lines that are")
    return (f"{what} no statement of polygons left out: {', '.join(kinds)}",)


def _from_zero(indices: Ints, kind: bytes, statements: _Statements, starts: Ints) -> Ints:
    """Indices counted from 1, or back from the face if negative, as indices counted from 0.

    One that counts back beyond the first statement stays negative, and 0 becomes negative: both are
    rejected later.
    """
    if np.all(indices > 0):
        return indices - 1
    kinds = np.array([kind for kind, _ in statements])
    above = np.repeat(np.cumsum(kinds == kind)[kinds == b"f"], np.diff(starts))
    return np.where(indices < 0, indices + above, indices - 1)


def _texture_indices(tokens: list[bytes]) -> Ints:
    """(C,) second index of each ``v/vt/vn``; 0 where there is none, or where any is unreadable."""
    texts = [token.partition(b"/")[2].partition(b"/")[0] for token in tokens]
    try:
        return np.array([text or b"0" for text in texts]).astype(np.int64)
    except (ValueError, OverflowError):
        return np.zeros(len(tokens), dtype=np.int64)


def _texture(rows: list[list[bytes]], places: Ints) -> Floats:
    """(C, 2) texture coordinates at places in the rows; NaN outside, and for unreadable rows.

    A second coordinate that is missing is 0.
    """
    pairs = [(*row, b"0")[:2] if row else (b"nan", b"nan") for row in rows]
    try:
        table = np.array(pairs).astype(np.float64)
    except ValueError:
        table = np.array([_pair(*pair) for pair in pairs])
    table = np.concatenate([table, [[np.nan, np.nan]]])
    return table[np.where((places < 0) | (places >= len(rows)), len(rows), places)]


def _pair(u: bytes, v: bytes) -> tuple[float, float]:
    try:
        return float(u), float(v)
    except ValueError:
        return np.nan, np.nan


def _with_names(mesh: RawMesh, statements: _Statements, folder: Path) -> RawMesh:
    """The mesh with its groups, labels and materials.

    Each ``o``, ``g`` (which may name several groups) and ``usemtl`` holds for the faces below it.
    """
    current = dict.fromkeys((b"o", b"g", b"usemtl"), "")
    libraries: list[str] = []
    row: tuple[str, ...] = tuple(current.values())
    rows: list[tuple[str, ...]] = []
    for kind, rest in statements:
        if kind == b"f":
            rows.append(row)
        elif kind in current:
            current[kind] = _name_in(rest)
            row = tuple(current.values())
        elif kind == b"mtllib":
            libraries.append(_name_in(rest))
    if not any(map(any, set(rows))):
        return mesh
    members, crowded = _members(rows)
    bodies, body_of = number_names([row[0] for row in rows])
    groups, group_of = number_names([row[1] for row in rows])
    used, material_of = number_names([row[2] for row in rows])
    known, notes = _read_materials(folder, tuple(libraries)) if used else ({}, [])
    materials = tuple(known.get(name, Material(name)) for name in used)
    return replace(
        mesh,
        groups={name: np.array(polygons, dtype=np.int64) for name, polygons in members.items()},
        labels=Labels(bodies, groups, materials, body_of, group_of, material_of),
        notes=(*mesh.notes, *crowded, *notes),
    )


def _members(rows: list[tuple[str, ...]]) -> tuple[dict[str, list[int]], tuple[str, ...]]:
    """Polygons of each group and object; and a note, without any, if all would take too much."""
    names = {group: group.split() for _, group, _ in rows}
    most = max(map(len, names.values())) + 1
    if most > 2 and most * len(rows) > MOST_MEMBERS:
        what = f"{len(rows)} polygons in up to {most} groups each are more than {MOST_MEMBERS}"
        return {}, (f"{what} members: the groups are left out",)
    members: dict[str, list[int]] = {}
    for polygon, (body, group, _) in enumerate(rows):
        for name in dict.fromkeys([*names[group], body]):
            members.setdefault(name, []).append(polygon)
    members.pop("", None)
    return members, ()


def encode_obj(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A text file with every digit, and its material file; all groups share the vertices."""
    paint = mesh.paint
    library = path.with_suffix(".mtl") if paint.materials else None
    lines = [] if library is None else [f"mtllib {library.name}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    place = None
    if mesh.uv is not None:
        # Missing coordinates are sorted to the end, and cut off.
        rows = np.where(np.isnan(mesh.uv), np.inf, mesh.uv).reshape(-1, 2)
        table, place = np.unique(rows, axis=0, return_inverse=True)
        table = table[np.isfinite(table[:, 0])]
        place = np.where(place < len(table), place + 1, 0).reshape(-1, 3)
        lines += [f"vt {u!r} {v!r}" for u, v in table.tolist()]
    parts = split_parts(mesh)
    # A name or material holds until the next statement.
    grouped, used = False, -1
    for names, material, chosen in zip(parts.names, parts.material, parts.triangles, strict=True):
        if names or grouped:
            lines.append(" ".join(["g", *map(obj_word, names)]))
            grouped = True
        if material not in (used, -1):
            used = material
            lines.append(f"usemtl {paint.names[used]}")
        lines += _face_lines(mesh.triangles[chosen] + 1, None if place is None else place[chosen])
    content = ("\n".join(lines) + "\n").encode()
    if library is None:
        return EncodedMesh(content)
    return EncodedMesh(content, {library: _encode_materials(paint, library.parent)})


def _face_lines(corners: Ints, place: Ints | None) -> Iterator[str]:
    if place is None:
        yield from (f"f {a} {b} {c}" for a, b, c in corners.tolist())
        return
    for (a, b, c), (p, q, r) in zip(corners.tolist(), place.tolist(), strict=True):
        yield f"f {a}/{p} {b}/{q} {c}/{r}" if p else f"f {a} {b} {c}"


def _read_materials(folder: Path, names: tuple[str, ...]) -> tuple[dict[str, Material], list[str]]:
    """Materials by name, and a note for each file or image that is left out.

    Each ``mtllib`` names one file, whose name may have spaces, or several.
    """
    found: dict[str, Material] = {}
    notes = []
    files = [
        part
        for name in dict.fromkeys(names)
        for part in ([name] if fault_of(folder / name) is None else name.split())
    ]
    for name in files:
        path = folder / name.replace("\\", "/")
        try:
            data = read_file(path)
        except FileError as error:
            notes.append(f"the colours of the material file {name} are left out: {error.message}")
            continue
        material = ""
        for kind, rest in _MATERIAL.findall(plain_lines(data)):
            if kind == b"newmtl":
                material = _name_in(rest)
                found.setdefault(material, Material(material))
            elif material not in found:
                continue
            elif kind == b"Kd":
                colour = parse_colour(rest.split()[:3]) or found[material].colour
                found[material] = replace(found[material], colour=colour)
            elif rest.startswith(b"-"):
                notes.append(f"the image of material {material} has options: it is left out")
            else:
                image = str(path.parent / _name_in(rest).replace("\\", "/"))
                found[material] = replace(found[material], image=image)
    return found, notes


def _name_in(rest: bytes) -> str:
    """The name in the rest of a statement. A comment begins with a space: names may hold ``#``."""
    return re.sub(rb"(^|\s)#.*", b"", rest).decode("utf-8", "replace").strip()


def _encode_materials(paint: Paint, folder: Path) -> bytes:
    """A material file in a folder; paths of images are relative to it."""
    lines = []
    for name, material in zip(paint.names, paint.materials, strict=True):
        lines.append(f"newmtl {name}")
        if material.colour is not None:
            lines.append("Kd " + " ".join(map(repr, map(float, material.colour))))
        if material.image is not None:
            lines.append(f"map_Kd {_relative(material.image, folder)}")
    return ("\n".join(lines) + "\n").encode()


def _relative(image: str, folder: Path) -> str:
    try:
        return Path(os.path.relpath(image, folder)).as_posix()
    except ValueError:  # on another drive
        return Path(image).absolute().as_posix()
