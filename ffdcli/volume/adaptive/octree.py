"""Octrees over a box, in integers, and other tilings of a region by boxes.

A cell is given by its low corner and its side in units of the finest cell. The leaves are in Morton
order, in which the cells inside any larger cell are consecutive, so a point is located by binary
search.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints

# Distance, as a share of a cell's side, within which a triangle counts as touching the cell.
TOUCH = 1e-9

CHILDREN = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=np.int64)


class Cells(Protocol):
    """Boxes with integer corners that tile a region: leaves of an octree, or given ones."""

    @property
    def counts(self) -> Ints:
        """(3,) units along each axis of the region."""
        ...

    @property
    def plane_counts(self) -> Ints:
        """(3,) planes across each axis of the least regular grid that has all boxes' sides."""
        ...

    @property
    def as_octree(self) -> Octree | None:
        """The boxes as leaves of an octree; None where they were given otherwise."""
        ...

    @property
    def low(self) -> Ints:
        """(N, 3) low corners of the boxes."""
        ...

    @property
    def high(self) -> Ints:
        """(N, 3) high corners of the boxes."""
        ...

    @property
    def levels(self) -> Ints:
        """(N,) level of each box: 0 is the whole region."""
        ...

    @property
    def corners(self) -> Ints:
        """(n, 3) corners of all boxes, each once."""
        ...

    @property
    def leaf_corners(self) -> Ints:
        """(N, 8) numbers of each box's corners, w fastest."""
        ...

    def locate(self, cells: Ints) -> Ints:
        """Box (m,) that holds each unit cell (m, 3), given by its low corner."""
        ...


class SharedCorners:
    """The shared corners of boxes that tile a region."""

    if TYPE_CHECKING:

        @property
        def low(self) -> Ints:
            """(N, 3) low corners of the boxes."""

        @property
        def high(self) -> Ints:
            """(N, 3) high corners of the boxes."""

    @cached_property
    def _corners(self) -> tuple[Ints, Ints]:
        """Corners (n, 3), each once, in Morton order; corner numbers (N, 8) of each box."""
        sides = self.low[:, None, :], self.high[:, None, :]
        every = np.where(CHILDREN == 1, sides[1], sides[0]).reshape(-1, 3)
        keys, index = np.unique(interleave(every), return_inverse=True)
        return separate(keys), index.reshape(-1, 8)

    @property
    def corners(self) -> Ints:
        """(n, 3) corners of all boxes, each once."""
        return self._corners[0]

    @property
    def leaf_corners(self) -> Ints:
        """(N, 8) numbers of each box's corners, w fastest."""
        return self._corners[1]


@dataclass(frozen=True)
class Octree(SharedCorners):
    """The leaves of an octree over the cube of ``2**depth`` finest units a side.

    Parameters
    ----------
    depth : int
    low : (N, 3) int64
        Low corners of the leaves in finest units, in Morton order.
    size : (N,) int64
        Sides of the leaves in finest units.
    """

    depth: int
    low: Ints
    size: Ints

    @cached_property
    def codes(self) -> Ints:
        """(N,) Morton codes of the low corners, increasing."""
        return interleave(self.low)

    @property
    def counts(self) -> Ints:
        """(3,) finest units along each axis."""
        return np.full(3, 1 << self.depth)

    @property
    def plane_counts(self) -> Ints:
        """(3,) planes across each axis of the grid of finest cells."""
        return self.counts + 1

    @property
    def as_octree(self) -> Octree:
        """This octree."""
        return self

    @property
    def high(self) -> Ints:
        """(N, 3) high corners of the leaves."""
        return np.asarray(self.low + self.size[:, None])

    @property
    def levels(self) -> Ints:
        """(N,) level of each leaf: 0 is the whole box."""
        return np.asarray(self.depth - np.log2(self.size).astype(np.int64))

    def locate(self, cells: Ints) -> Ints:
        """Leaf (m,) that holds each finest cell (m, 3), given by its low corner."""
        return np.searchsorted(self.codes, interleave(cells), side="right") - 1

    def meeting(
        self, low: Floats | Ints, high: Floats | Ints, among: Ints | None = None
    ) -> tuple[Ints, Ints]:
        """Find the pairs of box and leaf whose interiors meet.

        Parameters
        ----------
        low, high : (m, 3)
            Boxes in finest units. Along an axis where a box has no extent, touching suffices.
        among : (l,) int64, optional
            Leaves to test, increasing; all by default.

        Returns
        -------
        (p,), (p,) int64
            Numbers of box and of leaf, sorted by leaf, then box.
        """
        wanted = None if among is None else self.codes[among]
        # A box without extent is enlarged by the smallest step both ways, so that touching counts.
        flat = low == high
        start = np.where(flat, np.nextafter(low, -np.inf), low).T
        end = np.where(flat, np.nextafter(high, np.inf), high).T
        box = np.arange(len(low))
        code = np.zeros(len(low), dtype=np.int64)
        cell = np.zeros((3, len(low)))
        side, level = 1 << self.depth, 0
        found: list[Ints] = []
        count = max(1, len(low))
        while len(box):
            shift = 3 * (self.depth - level)
            if wanted is not None:
                # A cell holds a wanted leaf where the leaf's code is in the cell's range of codes.
                first = np.searchsorted(wanted, code << shift)
                last = np.searchsorted(wanted, (code + 1) << shift)
                kept = np.flatnonzero(last > first)
                box, cell, code = box[kept], cell[:, kept], code[kept]
            for axis in range(3):
                meets = (start[axis, box] < cell[axis] + side) & (end[axis, box] > cell[axis])
                kept = np.flatnonzero(meets)
                box, cell, code = box[kept], cell[:, kept], code[kept]
            leaf = np.searchsorted(self.codes, code << shift, side="right") - 1
            ends = self.size[leaf] >= side
            found.append(leaf[ends] * count + box[ends])
            side, level = side >> 1, level + 1
            going = np.flatnonzero(~ends)
            box = np.repeat(box[going], 8)
            code = ((code[going] << 3)[:, None] + np.arange(8)).ravel()
            cell = (cell[:, going, None] + side * CHILDREN.T[:, None, :]).reshape(3, -1)
        keys = np.sort(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)
        return keys % count, keys // count


AnyCells = TypeVar("AnyCells", bound=Cells, covariant=True)


@dataclass(frozen=True)
class ModelTree(Generic[AnyCells]):
    """An octree refined around a model, or given cells, and the cells that hold the model.

    Parameters
    ----------
    tree : Octree or other cells
    full : (N,) bool
        Cells that hold part of the model.
    """

    tree: AnyCells
    full: Bools


def interleave(cells: Ints) -> Ints:
    """Morton codes (...) of non-negative coordinates (..., 3) below 2**20, w fastest."""
    spread = np.asarray(cells, dtype=np.int64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        spread = (spread | (spread << shift)) & mask
    return np.asarray((spread[..., 0] << 2) | (spread[..., 1] << 1) | spread[..., 2])


def separate(codes: Ints) -> Ints:
    """Coordinates (..., 3) of Morton codes (...)."""
    spread = np.stack([codes >> 2, codes >> 1, codes], axis=-1) & 0x1249249249249249
    for shift, mask in (
        (2, 0x10C30C30C30C30C3),
        (4, 0x100F00F00F00F00F),
        (8, 0x1F0000FF0000FF),
        (16, 0x1F00000000FFFF),
        (32, 0x1FFFFF),
    ):
        spread = (spread | (spread >> shift)) & mask
    return np.asarray(spread)
