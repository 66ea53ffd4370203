"""Polygons of OBJ, OFF and ASCII STL files, with every polygon and every digit kept.

The general readers at hand fan concave polygons into inverted triangles, or round the numbers on
the way; the polygon part of these formats is small enough to be read here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.labels import Labels, Material, number_names
from ffdcli.mesh.io.materials import plain_name
from ffdcli.mesh.io.texture import from_indices

_STATEMENT = re.compile(rb"^[ \t]*(vt|[vfgo]|usemtl|mtllib)(?=[ \t]|$)[ \t]*(.*)$", re.MULTILINE)
# In the statements that hold names a comment needs a space before its mark: names may have one.
_OBJ_COMMENT = re.compile(rb"^([ \t]*(?:[go]|usemtl|mtllib)[ \t][^\n]*)$|#[^\n]*", re.MULTILINE)
_COMMENT = re.compile(rb"#[^\n]*")
_OFF_HEADER = re.compile(rb"\s*(?:ST)?C?N?OFF\b[ \t]*(BINARY\b)?")
_FACET = re.compile(rb"\bfacet\b", re.IGNORECASE)
_STL_VERTEX = re.compile(rb"\bvertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE)


@dataclass(frozen=True)
class TextPolygons:
    """What a text file says.

    Parameters
    ----------
    vertices : (V, 3) float64
    corners, starts : (C,) and (P + 1,) int64
        As in `Mesh`; indices are not checked yet.
    decimals : int
        Most decimals printed for any coordinate.
    groups : mapping of str to (n,) int64
        Polygons of each named group and object.
    labels : Labels or None
        Objects as bodies, groups, and materials, whose colours are in the libraries.
    libraries : tuple of str
        Files of materials.
    uv : (C, 2) float64 or None
        Texture coordinates of the corners; not finite where there are none.
    """

    vertices: Floats
    corners: Ints
    starts: Ints
    decimals: int
    groups: Mapping[str, Ints] = field(default_factory=dict)
    labels: Labels | None = None
    libraries: tuple[str, ...] = ()
    uv: Floats | None = None


def parse_obj(data: bytes, source: str) -> TextPolygons:
    """Read a Wavefront OBJ file: faces with texture coordinates, groups, objects, materials."""
    text = _plain_lines(data).replace(b"\\\n", b" ")
    statements = _STATEMENT.findall(_OBJ_COMMENT.sub(rb"\1", text))
    vertices, decimals = parse_coordinates(
        [rest.split(None, 3)[:3] for kind, rest in statements if kind == b"v"], source
    )
    faces = [rest.split() for kind, rest in statements if kind == b"f"]
    whole = list(chain.from_iterable(faces))
    tokens = [token.partition(b"/")[0] for token in whole]
    corners, starts = _ragged(tokens, [len(face) for face in faces], source)

    def above(kind: bytes) -> Ints:
        """How many statements of a kind stand above each corner's face."""
        kinds = np.array([kind for kind, _ in statements])
        return np.repeat(np.cumsum(kinds == kind)[kinds == b"f"], np.diff(starts))

    if np.any(corners <= 0):
        zero = np.flatnonzero(corners == 0)
        if len(zero):
            polygon = int(np.searchsorted(starts, zero[0], side="right")) - 1
            raise FileError(
                f"polygon {polygon} (counted from 0) refers to vertex 0, but OBJ counts from 1",
                file=source,
                hint="export the mesh again",
            )
        # Negative indices count back from the last vertex written above the face. One that reaches
        # back beyond the first vertex stays negative, and is refused as such.
        corners = np.where(corners < 0, corners + above(b"v"), corners - 1)
    else:
        corners = corners - 1
    groups, labels, libraries = _obj_names(statements)
    places = [rest for kind, rest in statements if kind == b"vt"]
    uv = from_indices(places, whole, above(b"vt")) if places else None
    return TextPolygons(vertices, corners, starts, decimals, groups, labels, libraries, uv)


def _obj_names(
    statements: list[tuple[bytes, bytes]],
) -> tuple[dict[str, Ints], Labels | None, tuple[str, ...]]:
    """Polygons below each `g` (which may name several groups) and `o`, their labels, libraries."""
    current = dict.fromkeys((b"o", b"g", b"usemtl"), "")
    libraries: list[str] = []
    rows: list[tuple[str, ...]] = []
    for kind, rest in statements:
        if kind == b"f":
            rows.append(tuple(current.values()))
        elif kind in current:
            current[kind] = plain_name(rest)
        elif kind == b"mtllib":
            libraries.append(plain_name(rest))
    members: dict[str, list[int]] = {}
    for polygon, (body, group, _) in enumerate(rows):
        for name in dict.fromkeys([*group.split(), body]):
            members.setdefault(name, []).append(polygon)
    members.pop("", None)
    groups = {name: np.array(polygons, dtype=np.int64) for name, polygons in members.items()}
    if not any(any(row) for row in rows):
        return groups, None, tuple(libraries)
    bodies, body_of = number_names([row[0] for row in rows])
    named, group_of = number_names([row[1] for row in rows])
    painted, material_of = number_names([row[2] for row in rows])
    materials = tuple(Material(name) for name in painted)
    labels = Labels(bodies, named, materials, body_of, group_of, material_of)
    return groups, labels, tuple(libraries)


def parse_off(data: bytes, source: str) -> TextPolygons:
    """Read an OFF file (also with normals, colours or texture coordinates, which are left out)."""
    text = _COMMENT.sub(b"", _plain_lines(data))
    header = _OFF_HEADER.match(text)
    if header is None or header[1]:
        raise FileError(
            "this is not an OFF text file: it must begin with OFF",
            file=source,
            hint="export it as text, three coordinates per vertex",
        )
    lines = [line for line in text[header.end() :].split(b"\n") if line.strip()]
    try:
        vertex_count, polygon_count = (int(token) for token in lines[0].split()[:2])
    except (IndexError, ValueError):
        raise FileError(
            "the line after OFF must give the numbers of vertices and polygons",
            file=source,
            hint="export the mesh again",
        ) from None
    if len(lines) < 1 + vertex_count + polygon_count or min(vertex_count, polygon_count) < 0:
        raise _truncated(
            source,
            f"the header promises {vertex_count} vertices and {polygon_count} polygons, "
            f"but only {len(lines) - 1} lines follow",
        )
    vertices, decimals = parse_coordinates(
        [line.split(None, 3)[:3] for line in lines[1 : 1 + vertex_count]], source
    )
    rows = [line.split() for line in lines[1 + vertex_count : 1 + vertex_count + polygon_count]]
    counts = parse_integers([row[0] for row in rows], source).tolist()
    missing = np.array([len(row) for row in rows], dtype=np.int64) <= counts
    if missing.any():
        raise _truncated(
            source, f"polygon {np.argmax(missing)} (counted from 0) has too few corners"
        )
    tokens = chain.from_iterable(
        row[1 : count + 1] for row, count in zip(rows, counts, strict=True)
    )
    corners, starts = _ragged(list(tokens), counts, source)
    return TextPolygons(vertices, corners, starts, decimals)


def parse_stl(data: bytes, source: str) -> TextPolygons:
    """Read an ASCII STL file, all its solids."""
    found = _STL_VERTEX.findall(data)
    facets = len(_FACET.findall(data))
    if not facets:
        raise FileError(
            "this is not an STL file: it has no facets, and its length is not the one its "
            "binary header promises",
            file=source,
            hint="export it again, or give it the extension of its own format",
        )
    if len(found) != 3 * facets:
        raise _truncated(source, f"its {facets} facets have {len(found)} vertices, not three each")
    vertices, decimals = parse_coordinates(found, source)
    return TextPolygons(vertices, np.arange(3 * facets), np.arange(0, 3 * facets + 1, 3), decimals)


def parse_coordinates(
    rows: list[list[bytes]] | list[tuple[bytes, ...]], source: str
) -> tuple[Floats, int]:
    """(V, 3) correctly rounded numbers of the rows, and the most decimals any of them prints."""
    short = next((n for n, row in enumerate(rows) if len(row) != 3), None)
    if short is not None:
        raise FileError(
            f"vertex {short} (counted from 0) does not have three coordinates",
            file=source,
            hint="export the mesh again",
        )
    if not rows:
        return np.empty((0, 3)), 0
    tokens = np.array(list(chain.from_iterable(rows)))
    try:
        numbers = tokens.astype(np.float64)
    except ValueError:
        bad = next(n for n, token in enumerate(tokens.tolist()) if not _is_number(token))
        raise FileError(
            f"a coordinate of vertex {bad // 3} (counted from 0) is not a number: "
            f"{tokens[bad].decode(errors='replace')}",
            file=source,
            hint="export the mesh again",
        ) from None
    return numbers.reshape(-1, 3), count_decimals(tokens)


def parse_integers(tokens: list[bytes], source: str) -> Ints:
    """(n,) int64 of the tokens."""
    if not tokens:
        return np.empty(0, dtype=np.int64)
    try:
        return np.array(tokens).astype(np.int64)
    except (ValueError, OverflowError):
        raise FileError(
            "a polygon has a corner that is not a whole number",
            file=source,
            hint="export the mesh again",
        ) from None


def count_decimals(tokens: NDArray[np.bytes_]) -> int:
    """Most decimals printed in (n,) numbers; ``1.5e-3`` has four, ``2e3`` minus three."""
    characters = tokens.view(np.uint8).reshape(len(tokens), -1)
    exponent_mark = (characters | 0x20) == ord("e")
    with_exponent = exponent_mark.any(axis=1)
    end = np.where(with_exponent, exponent_mark.argmax(axis=1), np.char.str_len(tokens))
    point = characters == ord(".")
    decimals = np.where(point.any(axis=1), end - point.argmax(axis=1) - 1, 0)
    if with_exponent.any():
        parts = np.char.partition(np.char.lower(tokens[with_exponent]), b"e")
        # No double has an exponent beyond 400.
        exponent = np.clip(parts[:, 2].astype(np.float64), -400, 400)
        decimals[with_exponent] -= exponent.astype(np.int64)
    return int(decimals.max())


def _ragged(tokens: list[bytes], counts: list[int], source: str) -> tuple[Ints, Ints]:
    starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)
    return parse_integers(tokens, source), starts


def _plain_lines(data: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _is_number(token: bytes) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True


def _truncated(source: str, message: str) -> FileError:
    return FileError(message, file=source, hint="the file may be cut short: export it again")
