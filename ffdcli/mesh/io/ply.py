"""Polygons of PLY files, ASCII and binary, with every polygon and every digit kept.

The readers at hand take binary files whose polygons have different numbers of corners for broken,
or round double precision to single.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.mesh.io.text import parse_coordinates, parse_integers

_TYPES = {
    name: code
    for code, names in {
        "i1": ("char", "int8"),
        "u1": ("uchar", "uint8"),
        "i2": ("short", "int16"),
        "u2": ("ushort", "uint16"),
        "i4": ("int", "int32"),
        "u4": ("uint", "uint32"),
        "f4": ("float", "float32"),
        "f8": ("double", "float64"),
    }.items()
    for name in names
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
# What the list of a face's corners is called.
_CORNERS = ("vertex_indices", "vertex_index")
# What texture coordinates are called, of faces as lists or of vertices.
_FACE_UV = "texcoord"
_VERTEX_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_END = b"end_header"


@dataclass(frozen=True)
class PlyPolygons:
    """What a PLY file says.

    Parameters
    ----------
    vertices : (V, 3) float64
    corners, starts : (C,) and (P + 1,) int64
        As in `Mesh`; indices are not checked yet.
    double : bool
        All three coordinates are declared as double precision.
    decimals : int or None
        Most decimals printed for any coordinate; None for binary files.
    uv : (C, 2) float64 or None
        Texture coordinates of the corners; not finite where there are none.
    """

    vertices: Floats
    corners: Ints
    starts: Ints
    double: bool
    decimals: int | None
    uv: Floats | None = None


@dataclass(frozen=True)
class _Property:
    """A column of an element: numbers, or lists whose length comes first."""

    name: str
    kind: str
    count_kind: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True)
class _Lists:
    """Lists of all rows, one after the other."""

    values: NDArray[Any]
    starts: Ints


_Column = NDArray[Any] | _Lists


def parse_ply(data: bytes, source: str) -> PlyPolygons:
    """Read vertices, faces and texture coordinates of a PLY file; all else is left out.

    Raises
    ------
    FileError
        The header is not PLY's, or the file ends before what it promises.
    """
    order, elements, body = _parse_header(data, source)
    read = _read_text if order == "" else _read_binary
    columns = read(data[body:], elements, order, source)
    by_name = {element.name: element for element in elements}
    points = [columns.get("vertex", {}).get(axis) for axis in "xyz"]
    if any(not isinstance(column, np.ndarray) for column in points):
        raise _bad_header(source, "it declares no element vertex with properties x, y and z")
    kinds = {p.kind for p in by_name["vertex"].properties if p.name in ("x", "y", "z")}
    faces = _find_faces(by_name.get("face"), columns)
    if order == "":
        rows = list(zip(*(column.tolist() for column in points), strict=True))  # type: ignore[union-attr]
        vertices, decimals = parse_coordinates(rows, source)
        corners = parse_integers(faces.values.tolist(), source)
    else:
        vertices, decimals = np.column_stack(points).astype(np.float64), None  # type: ignore[arg-type]
        corners = faces.values.astype(np.int64)
    uv = _find_uv(columns, corners, faces.starts)
    return PlyPolygons(vertices, corners, faces.starts, kinds == {"f8"}, decimals, uv)


def _find_uv(
    columns: Mapping[str, Mapping[str, _Column]], corners: Ints, starts: Ints
) -> Floats | None:
    """(C, 2) texture coordinates: those of faces, else those of vertices; None for neither."""
    lists = columns.get("face", {}).get(_FACE_UV)
    vertex = columns["vertex"]
    pair = next((names for names in _VERTEX_UV if all(name in vertex for name in names)), None)
    try:
        if isinstance(lists, _Lists):
            uv = np.full((len(corners), 2), np.nan)
            # Faces without any have an empty list.
            fits = np.repeat(np.diff(lists.starts) == 2 * np.diff(starts), np.diff(starts))
            taken = np.repeat(np.diff(lists.starts) == 2 * np.diff(starts), np.diff(lists.starts))
            uv[fits] = lists.values[taken].astype(np.float64).reshape(-1, 2)
            return uv
        found = [vertex[name] for name in pair or ()]
        plain = [column for column in found if not isinstance(column, _Lists)]
        if len(plain) < 2:
            return None
        table = np.column_stack(plain).astype(np.float64)
    except ValueError:  # text that is no number
        return np.full((len(corners), 2), np.nan)
    table = np.concatenate([table, [[np.nan, np.nan]]])
    # Corners without a vertex are refused later.
    beyond = (corners < 0) | (corners >= len(table) - 1)
    return np.asarray(table[np.where(beyond, -1, corners)])


def _find_faces(element: _Element | None, columns: Mapping[str, Mapping[str, _Column]]) -> _Lists:
    """The lists of corners: by name, else the first lists of whole numbers."""
    properties = () if element is None else element.properties
    lists = [p.name for p in properties if p.count_kind and not p.kind.startswith("f")]
    lists.sort(key=lambda name: name not in _CORNERS)
    faces = columns["face"][lists[0]] if lists else None
    if isinstance(faces, _Lists):
        return faces
    return _Lists(np.empty(0, dtype=np.int64), np.zeros(1, dtype=np.int64))


def _parse_header(data: bytes, source: str) -> tuple[str, tuple[_Element, ...], int]:
    """Byte order, elements, and where the body begins."""
    end = data.find(_END)
    if not data.startswith(b"ply") or end < 0:
        raise _bad_header(source, "it must begin with ply and have a line end_header")
    body = end + len(_END)
    body += 2 if data[body : body + 2] == b"\r\n" else 1
    order: str | None = None
    elements: list[_Element] = []
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2]), ()))
                if elements[-1].count < 0:
                    raise ValueError(line)
            elif words[0] == "property":
                column = (
                    _Property(words[4], _TYPES[words[3]], _integer_kind(words[2]))
                    if words[1] == "list"
                    else _Property(words[2], _TYPES[words[1]])
                )
                last = elements.pop()
                elements.append(_Element(last.name, last.count, (*last.properties, column)))
            else:
                raise ValueError(line)
        except (IndexError, KeyError, ValueError):
            raise _bad_header(source, f"a line of it cannot be read: {line.strip()}") from None
    if order is None:
        raise _bad_header(source, "it does not say ascii or binary")
    return order, tuple(element for element in elements if element.properties), body


def _integer_kind(name: str) -> str:
    kind = _TYPES[name]
    if kind.startswith("f"):
        raise ValueError(name)
    return kind


def _read_text(
    data: bytes, elements: tuple[_Element, ...], _: str, source: str
) -> Mapping[str, Mapping[str, _Column]]:
    """Columns of tokens."""
    tokens = np.array(data.split() or [b""])
    at = 0
    found: dict[str, Mapping[str, _Column]] = {}
    for element in elements:
        if all(p.count_kind is None for p in element.properties):
            width = len(element.properties)
            rows = tokens[at : at + width * element.count]
            if len(rows) != width * element.count:
                raise _cut_short(source, element)
            at += len(rows)
            table = rows.reshape(element.count, width)
            found[element.name] = {p.name: table[:, n] for n, p in enumerate(element.properties)}
            continue
        if element.count * len(element.properties) > len(tokens) - at:
            raise _cut_short(source, element)
        places = np.empty((element.count, len(element.properties)), dtype=np.int64)
        lengths = np.ones_like(places)
        for row in range(element.count):
            for n, column in enumerate(element.properties):
                if at >= len(tokens):
                    raise _cut_short(source, element)
                if column.count_kind is not None:
                    lengths[row, n] = _list_length(tokens[at], element, row, source)
                    at += 1
                places[row, n] = at
                at += int(lengths[row, n])
        if at > len(tokens):
            raise _cut_short(source, element)
        found[element.name] = {
            p.name: tokens[places[:, n]]
            if p.count_kind is None
            else _Lists(tokens[_spans(places[:, n], lengths[:, n])], _starts(lengths[:, n]))
            for n, p in enumerate(element.properties)
        }
    return found


def _list_length(token: bytes, element: _Element, row: int, source: str) -> int:
    try:
        length = int(token)
    except ValueError:
        length = -1
    if length < 0:
        raise FileError(
            f"row {row} (counted from 0) of element {element.name} does not begin with the number"
            " of its entries",
            file=source,
            hint="export the mesh again",
        )
    return length


def _read_binary(
    data: bytes, elements: tuple[_Element, ...], order: str, source: str
) -> Mapping[str, Mapping[str, _Column]]:
    """Columns of numbers."""
    at = 0
    found: dict[str, Mapping[str, _Column]] = {}
    for element in elements:
        if all(p.count_kind is None for p in element.properties):
            kind = np.dtype([(f"{n}", order + p.kind) for n, p in enumerate(element.properties)])
            if at + kind.itemsize * element.count > len(data):
                raise _cut_short(source, element)
            table = np.frombuffer(data, kind, element.count, at)
            at += table.nbytes
            found[element.name] = {p.name: table[f"{n}"] for n, p in enumerate(element.properties)}
        else:
            places, lengths, at = _walk(data, at, element, order, source)
            found[element.name] = {
                p.name: _gather(data, places[:, n], lengths[:, n], p, order)
                for n, p in enumerate(element.properties)
            }
    return found


def _walk(
    data: bytes, at: int, element: _Element, order: str, source: str
) -> tuple[Ints, Ints, int]:
    """Offset and length of every entry of rows with lists: each row's size is told by the rows."""
    kinds = [(np.dtype(p.kind).itemsize, p.count_kind) for p in element.properties]
    columns = [
        (size, np.dtype(head).itemsize if head else 0, head is not None and head.startswith("i"))
        for size, head in kinds
    ]
    if element.count * sum(head or size for size, head, _ in columns) > len(data) - at:
        raise _cut_short(source, element)
    byteorder: Literal["little", "big"] = "little" if order == "<" else "big"
    places, lengths = [], []
    for row in range(element.count):
        for size, head, sign in columns:
            length = 1
            if head:
                length = int.from_bytes(data[at : at + head], byteorder, signed=sign)
                at += head
                if length < 0:
                    _list_length(b"", element, row, source)
            places.append(at)
            lengths.append(length)
            at += size * length
        if at > len(data):
            raise _cut_short(source, element)
    shape = (element.count, len(columns))
    return (
        np.array(places, dtype=np.int64).reshape(shape),
        np.array(lengths, dtype=np.int64).reshape(shape),
        at,
    )


def _gather(data: bytes, places: Ints, lengths: Ints, column: _Property, order: str) -> _Column:
    kind = np.dtype(order + column.kind)
    first = np.repeat(places, lengths) + kind.itemsize * _spans(np.zeros_like(places), lengths)
    octets = np.frombuffer(data, np.uint8)[first[:, None] + np.arange(kind.itemsize)]
    values = np.ascontiguousarray(octets).view(kind).ravel()
    return values if column.count_kind is None else _Lists(values, _starts(lengths))


def _starts(lengths: Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _spans(places: Ints, lengths: Ints) -> Ints:
    """Indices of the runs of given lengths that begin at the places."""
    begin = _starts(lengths)
    return np.repeat(places - begin[:-1], lengths) + np.arange(begin[-1])


def _bad_header(source: str, what: str) -> FileError:
    return FileError(
        f"the header is not that of a PLY file: {what}",
        file=source,
        hint="export it again, or give it the extension of its own format",
    )


def _cut_short(source: str, element: _Element) -> FileError:
    return FileError(
        f"the header promises {element.count} of element {element.name}, but the file ends before",
        file=source,
        hint="the file may be cut short: export it again",
    )
