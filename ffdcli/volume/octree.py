"""Octrees over a box, in integers: refined where a model is, balanced, corners shared.

A cell is its low corner and its side in units of the finest cell. The leaves are kept in Morton
order, in which the cells inside any larger cell follow on one another, so that looking up a place
is a binary search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ffdcli.volume.overlap import touches_boxes, unit_directions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Bits of a coordinate that an interleaved code holds.
MAX_DEPTH = 20
# A triangle within this share of a cell's side of it touches it, whatever rounding says.
TOUCH = 1e-9
# Pairs of triangle and cell looked at together: bounds the memory.
_CHUNK = 100_000

CHILDREN = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=np.int64)
_AROUND = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)])


class Cells(Protocol):
    """Boxes with integer corners that tile a region: leaves of an octree, or given ones."""

    @property
    def counts(self) -> Ints:
        """(3,) units along each axis of the region."""
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
    """The corners of boxes that tile a region, for whatever has such boxes."""

    if TYPE_CHECKING:

        @property
        def low(self) -> Ints:
            """(N, 3) low corners of the boxes."""

        @property
        def high(self) -> Ints:
            """(N, 3) high corners of the boxes."""

    @cached_property
    def _corners(self) -> tuple[Ints, Ints]:
        """Corners (n, 3), each once, in Morton order; numbers (N, 8) of each box's own."""
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
        Their sides in finest units.
    """

    depth: int
    low: Ints
    size: Ints

    @cached_property
    def codes(self) -> Ints:
        """(N,) interleaved low corners, rising."""
        return interleave(self.low)

    @property
    def counts(self) -> Ints:
        """(3,) finest units along each axis."""
        return np.full(3, 1 << self.depth)

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
        """Pairs of box and leaf whose interiors meet.

        Parameters
        ----------
        low, high : (m, 3)
            Boxes in finest units. Along an axis where a box has no extent, touching counts.
        among : (l,) int64, optional
            Leaves to look at, rising; all by default.

        Returns
        -------
        (p,), (p,) int64
            Numbers of box and of leaf, sorted by leaf, then box.
        """
        wanted = None if among is None else self.codes[among]
        # Where a box has no extent the least of both ways makes touching a meeting.
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
                # Cells that hold a wanted leaf: its code is in the cell's range of codes.
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


@dataclass(frozen=True)
class Region:
    """Part of the box that is refined to a depth of its own, wherever the model is.

    Parameters
    ----------
    low, high : (3,) float64
        As fractions of the octree's box.
    depth : int
    """

    low: Floats
    high: Floats
    depth: int


AnyCells = TypeVar("AnyCells", bound=Cells, covariant=True)


@dataclass(frozen=True)
class ModelTree(Generic[AnyCells]):
    """An octree refined round a model, or cells given.

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


def grow(
    triangles: Floats | None, points: Floats | None, depth: int, regions: Sequence[Region] = ()
) -> ModelTree[Octree]:
    """Refine a box where a model is, and balance the octree.

    Parameters
    ----------
    triangles : (T, 3, 3) float64, or None
        Fractions of the box. Cells that a triangle touches are divided down to ``depth``.
    points : (m, 3) float64, or None
        Instead: cells that hold a point are (Song & Yang 2005, section 4, step 2).
    depth : int
    regions : sequence of Region
        Cells that meet one are divided down to its depth.

    Returns
    -------
    ModelTree
        Cells that touch differ by at most one level.
    """
    deepest = max([depth, *(region.depth for region in regions)])
    divided = [np.zeros(0, dtype=np.int64) for _ in range(deepest)]
    for region in regions:
        for level in range(region.depth):
            divided[level] = np.union1d(divided[level], _cells_meeting(region, level))
    if triangles is not None:
        touched = _touched_by_triangles(triangles, depth, divided)
    else:
        touched = _holding_points(np.zeros((0, 3)) if points is None else points, deepest)
    for level in range(depth):
        divided[level] = np.union1d(divided[level], touched[level])
    tree = tree_of(balanced(divided))
    levels = tree.levels
    full = np.zeros(len(tree.size), dtype=bool)
    for here in range(deepest + 1):
        at = np.flatnonzero(levels == here)
        full[at] = np.isin(tree.codes[at] >> 3 * (deepest - here), touched[here])
    return ModelTree(tree, full)


def balanced(divided: Sequence[Ints]) -> list[Ints]:
    """Divide further cells until cells that touch differ by at most one level.

    Parameters
    ----------
    divided : sequence of (c,) int64
        Codes of the cells that are divided, per level, in units of that level.
    """
    out = [np.asarray(codes) for codes in divided]
    for level in range(len(out) - 1, 0, -1):
        around = (separate(out[level])[:, None, :] + _AROUND).reshape(-1, 3)
        around = around[np.all((around >= 0) & (around < 1 << level), axis=1)]
        # A cell exists where its parent is divided.
        out[level - 1] = np.union1d(out[level - 1], interleave(around) >> 3)
    return out


def tree_of(divided: Sequence[Ints]) -> Octree:
    """The octree in which these cells are divided, and all that they lie in.

    Parameters
    ----------
    divided : sequence of (c,) int64
        As for :func:`balanced`; level 0 is the whole box.
    """
    depth = len(divided)
    closed = [np.asarray(codes) for codes in divided]
    for level in range(depth - 1, 0, -1):
        closed[level - 1] = np.union1d(closed[level - 1], closed[level] >> 3)
    codes, sizes = [], []
    here = np.zeros(1, dtype=np.int64)
    for level in range(depth + 1):
        inner = np.isin(here, closed[level]) if level < depth else np.zeros(len(here), dtype=bool)
        codes.append(here[~inner] << 3 * (depth - level))
        sizes.append(np.full(len(codes[-1]), 1 << (depth - level), dtype=np.int64))
        here = ((here[inner] << 3)[:, None] + np.arange(8)).ravel()
    code = np.concatenate(codes)
    order = np.argsort(code)
    return Octree(depth, separate(code[order]), np.concatenate(sizes)[order])


def _cells_meeting(region: Region, level: int) -> Ints:
    """Codes of the cells of a level whose interior meets a region."""
    count = 1 << level
    # A region's side on a cell's side, within rounding, does not reach beyond it.
    low = np.floor(region.low * count + TOUCH).clip(0, count).astype(np.int64)
    high = np.ceil(region.high * count - TOUCH).clip(0, count).astype(np.int64)
    axes = [np.arange(first, last) for first, last in zip(low, high, strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.unique(interleave(cells))


def _holding_points(points: Floats, depth: int) -> list[Ints]:
    """Codes, per level, of the cells that hold a point; those on the far sides are inside."""
    beyond = np.any((points < 0) | (points > 1), axis=1)
    count = 1 << depth
    cells = np.floor(points[~beyond] * count).astype(np.int64).clip(0, count - 1)
    finest = np.unique(interleave(cells))
    return [np.unique(finest >> 3 * (depth - level)) for level in range(depth + 1)]


def _touched_by_triangles(triangles: Floats, depth: int, divided: Sequence[Ints]) -> list[Ints]:
    """Codes, per level, of the cells that triangles touch.

    Below ``depth`` only cells inside divided ones are looked at.
    """
    deepest = len(divided)
    normals, edges = unit_directions(triangles)
    lowest, highest = triangles.min(axis=1), triangles.max(axis=1)
    extent = (highest - lowest).max(axis=1)
    owner = np.arange(len(triangles))
    code = np.zeros(len(triangles), dtype=np.int64)
    touched: list[Ints] = []
    for level in range(deepest + 1):
        side = 1.0 / (1 << level)
        slack = TOUCH * side
        low: Floats = separate(code).astype(np.float64) * side - slack
        high: Floats = low + (side + 2 * slack)
        near = np.all((lowest[owner] <= high) & (highest[owner] >= low), axis=1)
        owner, code, low, high = owner[near], code[near], low[near], high[near]
        # Triangles smaller than the cells are looked at closely only where it is decided.
        meets = np.ones(len(owner), dtype=bool)
        asked = np.flatnonzero((extent[owner] > side) | (level >= depth))
        for start in range(0, len(asked), _CHUNK):
            part = asked[start : start + _CHUNK]
            corners = triangles[owner[part]]
            held = (corners >= low[part, None]) & (corners <= high[part, None])
            # Where no corner lies in the cell, the triangle may still pass it.
            part = part[~np.any(np.all(held, axis=2), axis=1)]
            t = owner[part]
            meets[part] = touches_boxes(triangles[t], normals[t], edges[t], low[part], high[part])
        owner, code = owner[meets], code[meets]
        touched.append(np.unique(code))
        if depth <= level < deepest:
            inner = np.isin(code, divided[level])
            owner, code = owner[inner], code[inner]
        owner = np.repeat(owner, 8)
        code = ((code << 3)[:, None] + np.arange(8)).ravel()
    # A cell above is touched where one of its parts is.
    for level in range(depth, 0, -1):
        touched[level - 1] = np.unique(touched[level] >> 3)
    return touched
