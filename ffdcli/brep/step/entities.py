"""Entities of a STEP file: numbered by arithmetic, printed in pieces of bounded size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.step.text import real_rows

# Values that are printed at once: some ten megabytes of text and lists.
PIECE = 200_000


@dataclass(frozen=True)
class Texts:
    """A text of each entity: the numbers (n,) of their texts in a list."""

    number: Ints
    texts: list[bytes]


# (n,) or (n, k) integers, each printed for a %d of the template; (n,) booleans, as T or F for a %s;
# reals (n, k), a row for a %s, or (n, m, k), for m of them; texts, each for a %s.
Field = Ints | Bools | Floats | Texts


@dataclass(frozen=True)
class Block:
    """Entities of one kind with consecutive numbers.

    Parameters
    ----------
    first, count : int
    template : bytes
        An entity, with places for its values as of Python's ``%``.
    fields : tuple of Field
        Values of the places, in order.
    """

    first: int
    count: int
    template: bytes
    fields: tuple[Field, ...]

    def pieces(self, values: int = PIECE) -> Iterator[bytes]:
        """Yield the text of some of the entities at a time, of about ``values`` values each."""
        width = 1 + self.template.count(b"%") + sum(map(_reals_each, self.fields))
        step = max(1, values // width)
        for begin in range(0, self.count, step):
            yield self._text(begin, min(begin + step, self.count))

    def _text(self, begin: int, end: int) -> bytes:
        part = slice(begin, end)
        columns: list[list[Any]] = [list(range(self.first + begin, self.first + end))]
        for field in self.fields:
            columns += _columns(field, part)
        count = end - begin
        values: list[Any] = [0] * (count * len(columns))
        for place, column in enumerate(columns):
            values[place :: len(columns)] = column
        line = b"#%d=" + self.template + b";\n"
        return (line * count) % tuple(values)


def _reals_each(field: Field) -> int:
    """How many reals a field has for each entity."""
    if isinstance(field, Texts) or field.dtype.kind != "f" or not len(field):
        return 0
    return field[0].size


def _columns(field: Field, part: slice) -> list[list[Any]]:
    """Lists of the values for each place of a field, for some of the entities."""
    if isinstance(field, Texts):
        return [list(map(field.texts.__getitem__, field.number[part].tolist()))]
    rows = field[part]
    if rows.dtype.kind == "b":
        return [[b"T" if value else b"F" for value in rows.tolist()]]
    if rows.dtype.kind == "f":
        tables = rows.swapaxes(0, 1) if rows.ndim == 3 else rows[None]
        return [real_rows(table) for table in tables]
    return list(rows.reshape(len(rows), -1).T.tolist())


class Entities:
    """Entities in the order of their file, each numbered as it is added, from 1."""

    def __init__(self) -> None:
        self.count = 0
        self._blocks: list[Block | bytes] = []

    def add(self, template: bytes, *fields: Field) -> Ints:
        """Add entities of one kind: their numbers (n,)."""
        head = fields[0]
        count = len(head.number if isinstance(head, Texts) else head)
        first = self.count + 1
        if count:
            self._blocks.append(Block(first, count, template, fields))
            self.count += count
        return np.arange(first, first + count)

    def one(self, entity: bytes) -> int:
        """Add one entity: its number."""
        self.count += 1
        self._blocks.append(b"#%d=%s;\n" % (self.count, entity))
        return self.count

    def pieces(self, values: int = PIECE) -> Iterator[bytes]:
        """Yield the text of all entities, of about ``values`` values at a time."""
        for block in self._blocks:
            if isinstance(block, bytes):
                yield block
            else:
                yield from block.pieces(values)
