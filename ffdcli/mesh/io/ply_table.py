"""The table in a PLY file: elements with columns of numbers or lists, from text or binary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Ints, places_in_runs, run_starts
from ffdcli.errors import FileError
from ffdcli.mesh.io.text_numbers import number_table, truncated

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
# Byte order by the name of the format; "" for text.
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = b"end_header"
# Elements whose lists of corners are polygons, or strips of triangles; names of these lists.
FACES, STRIPS = "face", "tristrips"
CORNERS = ("vertex_indices", "vertex_index")
# Rows that are compared at once with the row before them.
_FEWEST_ROWS, _MOST_ROWS = 16, 1 << 20
# Rows that are read in turn after rows of different lengths.
_MOST_WAITS = 64


@dataclass(frozen=True)
class Property:
    """A column of an element, with the numpy type codes of its numbers and of lengths of lists.

    The latter is None for plain numbers.
    """

    name: str
    kind: str
    count_kind: str | None = None


@dataclass(frozen=True)
class Element:
    """A kind of row: its name, the number of rows, and its columns."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class ListColumn:
    """Lists of all rows, one after another: list ``i`` is ``values[starts[i]:starts[i + 1]]``."""

    values: NDArray[Any]
    starts: Ints


Column = NDArray[Any] | ListColumn


@dataclass(frozen=True)
class PlyTable:
    """Declared columns of each element of a PLY file, and their content by element and name.

    Columns of a text file hold its tokens as bytes.
    """

    is_text: bool
    properties: Mapping[str, tuple[Property, ...]]
    columns: Mapping[str, Mapping[str, Column]]


def read_table(data: bytes, source: str, needed: Sequence[str]) -> PlyTable:
    """Read a PLY file: the declared columns of all elements, and the content of those needed.

    Raises
    ------
    FileError
        The header is not that of PLY, or the file ends too early.
    """
    order, elements, body = _parse_header(data, source)
    for element in elements:
        _require_room(element, len(data) - body, order != "", source)
    if order:
        columns = _read_binary(data[body:], elements, order, source, needed)
    else:
        columns = _read_text(data[body:], elements, source)
    return PlyTable(order == "", {each.name: each.properties for each in elements}, columns)


def _parse_header(data: bytes, source: str) -> tuple[str, tuple[Element, ...], int]:
    """Byte order, elements, and the offset of the body."""
    end = data.find(_END)
    if not data.startswith(b"ply") or end < 0:
        raise bad_header(source, "it must begin with ply and have a line end_header")
    body = end + len(_END)
    body += 2 if data[body : body + 2] == b"\r\n" else 1
    order: str | None = None
    elements: list[Element] = []
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(Element(words[1], int(words[2]), ()))
                if elements[-1].count < 0:
                    raise ValueError(line)
            elif words[0] == "property":
                column = (
                    Property(words[4], _TYPES[words[3]], _integer_kind(words[2]))
                    if words[1] == "list"
                    else Property(words[2], _TYPES[words[1]])
                )
                last = elements.pop()
                elements.append(Element(last.name, last.count, (*last.properties, column)))
            elif elements:
                raise ValueError(line)
            # Before the elements it is a remark: exporters forget the word comment.
        except (IndexError, KeyError, ValueError):
            raise bad_header(source, f"this line cannot be read: {line.strip()}") from None
    if order is None:
        raise bad_header(source, "it does not say ascii or binary")
    return order, tuple(element for element in elements if element.properties), body


def _require_room(element: Element, size: int, binary: bool, source: str) -> None:
    """Reject rows that the bytes of a file cannot hold, before memory is taken for them."""
    least = 0
    for column in element.properties:
        entries = 1
        if column.count_kind is not None:
            least += np.dtype(column.count_kind).itemsize if binary else 2
            # No polygon and no strip has fewer corners.
            corners = element.name in (FACES, STRIPS) and column.name in CORNERS
            entries = 3 if corners else 0
        least += entries * (np.dtype(column.kind).itemsize if binary else 2)
    # The last token needs no separator.
    if element.count * least > size + (not binary):
        each = " with three corners each" if element.name in (FACES, STRIPS) else ""
        raise truncated(
            source,
            f"the header promises {element.count} of element {element.name}, but the {size} bytes "
            f"after it cannot hold so many{each}",
        )


def _integer_kind(name: str) -> str:
    kind = _TYPES[name]
    if kind.startswith("f"):
        raise ValueError(name)
    return kind


def _read_text(
    data: bytes, elements: tuple[Element, ...], source: str
) -> dict[str, Mapping[str, Column]]:
    """Columns of tokens."""
    tokens = number_table(data.split() or [b""])
    at = 0
    found: dict[str, Mapping[str, Column]] = {}
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
                    length = _list_length(tokens[at], element, row, source)
                    at += 1
                    if length > len(tokens) - at:
                        raise _cut_short(source, element)
                    lengths[row, n] = length
                places[row, n] = at
                at += int(lengths[row, n])
        if at > len(tokens):
            raise _cut_short(source, element)
        found[element.name] = {
            p.name: tokens[places[:, n]]
            if p.count_kind is None
            else ListColumn(
                tokens[np.repeat(places[:, n], lengths[:, n]) + places_in_runs(lengths[:, n])],
                run_starts(lengths[:, n]),
            )
            for n, p in enumerate(element.properties)
        }
    return found


def _list_length(token: bytes, element: Element, row: int, source: str) -> int:
    try:
        length = int(token)
    except ValueError:
        length = -1
    if length < 0:
        raise FileError(
            f"row {row} (counted from 0) of element {element.name} does not begin with the number"
            " of its entries, or a row before it has more entries than the header declares",
            file=source,
            hint="export the mesh again",
        )
    return length


def _read_binary(
    data: bytes,
    elements: tuple[Element, ...],
    order: str,
    source: str,
    needed: Sequence[str],
) -> dict[str, Mapping[str, Column]]:
    """Columns of numbers."""
    at = 0
    found: dict[str, Mapping[str, Column]] = {}
    for element in elements:
        if all(p.count_kind is None for p in element.properties):
            kind = np.dtype([(f"{n}", order + p.kind) for n, p in enumerate(element.properties)])
            if at + kind.itemsize * element.count > len(data):
                raise _cut_short(source, element)
            table = np.frombuffer(data, kind, element.count, at)
            at += table.nbytes
            found[element.name] = {p.name: table[f"{n}"] for n, p in enumerate(element.properties)}
        else:
            kept = element.name in needed
            places, lengths, at = _find_entries(data, at, element, order, source, kept=kept)
            if not kept:
                continue
            found[element.name] = {
                p.name: _column(data, places[:, n], lengths[:, n], p, order)
                for n, p in enumerate(element.properties)
            }
    return found


def _find_entries(
    data: bytes, at: int, element: Element, order: str, source: str, *, kept: bool
) -> tuple[Ints, Ints, int]:
    """Offset and length of every entry (rows, columns) of an element with lists, and its end.

    The size of a row is known only after it has been read, so the rows are read in turn; but most
    have lists as long as those of the row before, and these are found many at a time. If they are
    not ``kept``, only the end is found.
    """
    kinds = [(np.dtype(p.kind).itemsize, p.count_kind) for p in element.properties]
    columns = [
        (size, np.dtype(head).itemsize if head else 0, head is not None and head.startswith("i"))
        for size, head in kinds
    ]
    byteorder: Literal["little", "big"] = "little" if order == "<" else "big"
    # Offsets and lengths of a row, its size, and the number of rows in turn that are like it.
    runs: list[tuple[int, ...]] = []
    octets = np.frombuffer(data, np.uint8)
    row, most, wait = 0, _FEWEST_ROWS, 0
    while row < element.count:
        begin = at
        heads, entries, sizes = [], [], []
        for size, head, sign in columns:
            length = 1
            if head:
                length = int.from_bytes(data[at : at + head], byteorder, signed=sign)
                heads.append((at - begin, head))
                at += head
                if length < 0:
                    _list_length(b"", element, row, source)
            entries.append(at)
            sizes.append(length)
            at += size * length
        if at > len(data):
            raise _cut_short(source, element)
        same, stride = 1, at - begin
        if wait:
            wait -= 1
        else:
            ahead = min(most, element.count - row, (len(data) - begin) // stride)
            block = octets[begin : begin + ahead * stride].reshape(ahead, stride)
            equal = np.ones(ahead, dtype=bool)
            for place, head in heads:
                equal &= (block[:, place : place + head] == block[0, place : place + head]).all(1)
            same = ahead if equal.all() else int(np.argmin(equal))
            # Where rows alternate, comparing costs more than reading.
            most = min(4 * most, _MOST_ROWS) if same == ahead else _FEWEST_ROWS
            wait = 0 if same > 2 else _MOST_WAITS
        at = begin + same * stride
        row += same
        if kept:
            runs.append((*entries, *sizes, stride, same))
    table = np.array(runs, dtype=np.int64).reshape(-1, 2 * len(columns) + 2)
    alike = table[:, -1]
    rows = np.repeat(table, alike, axis=0)
    steps = rows[:, -2] * places_in_runs(alike)
    return rows[:, : len(columns)] + steps[:, None], rows[:, len(columns) : -2], at


def _column(data: bytes, places: Ints, lengths: Ints, column: Property, order: str) -> Column:
    kind = np.dtype(order + column.kind)
    first = np.repeat(places, lengths) + kind.itemsize * places_in_runs(lengths)
    octets = np.frombuffer(data, np.uint8)[first[:, None] + np.arange(kind.itemsize)]
    values = np.ascontiguousarray(octets).view(kind).ravel()
    return values if column.count_kind is None else ListColumn(values, run_starts(lengths))


def bad_header(source: str, what: str) -> FileError:
    """An error for a header that is not that of PLY."""
    return FileError(
        f"the header is not that of a PLY file: {what}",
        file=source,
        hint="export it again, or give it the extension of its own format",
    )


def _cut_short(source: str, element: Element) -> FileError:
    what = f"{element.count} of element {element.name}"
    return truncated(source, f"the header promises {what}, but the file ends before")
