"""Growth of octrees: refinement around a model, and balancing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.adaptive.octree import TOUCH, ModelTree, Octree, interleave, separate
from ffdcli.volume.convex_overlap import touches_boxes, unit_directions

# Largest number of cells of an octree: its functions take some 20 s and half a gigabyte.
MAX_CELLS = 200_000
# Pairs of triangle and cell tested together: bounds the memory.
_CHUNK = 100_000

_AROUND = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)])


class TooManyCells(ValueError):
    """An octree would have more than :data:`MAX_CELLS` cells.

    Parameters
    ----------
    least : int
        Number of cells known when growth stopped: there would be at least so many.
    region : int or None
        Number of the region that needs them by itself.
    """

    def __init__(self, least: int, region: int | None = None) -> None:
        super().__init__(f"{least:,} cells or more")
        self.least = least
        self.region = region


@dataclass(frozen=True)
class Region:
    """Part of the box that is refined to a given depth, independent of the model.

    Parameters
    ----------
    low, high : (3,) float64
        Corners as fractions of the octree's box.
    depth : int
    """

    low: Floats
    high: Floats
    depth: int


def grow(
    triangles: Floats | None,
    points: Floats | None,
    depth: int,
    regions: Sequence[Region] = (),
    balance: bool = True,
    given: Sequence[Ints] = (),
) -> ModelTree[Octree]:
    """Refine a box around a model, and balance the octree.

    Parameters
    ----------
    triangles : (T, 3, 3) float64, or None
        Fractions of the box. Cells that a triangle touches are divided down to ``depth``.
    points : (m, 3) float64, or None
        Used instead: cells that hold a point are divided (Song & Yang 2005, section 4, step 2).
    depth : int
    regions : sequence of Region
        Cells that meet a region are divided down to its depth.
    balance : bool
        Divide further cells, so that cells that touch differ by at most one level.
    given : sequence of (c,) int64
        Codes of cells that are divided in any case, per level, in units of that level.

    Raises
    ------
    TooManyCells
        Found from the numbers of divided cells, before the cells are made.
    """
    deepest = max([depth, len(given), *(region.depth for region in regions)])
    divided = [np.zeros(0, dtype=np.int64) for _ in range(deepest)]
    divided[: len(given)] = given
    for number, region in enumerate(regions):
        _require_few(_number_meeting(region, region.depth - 1) * 8, number)
        for level in range(region.depth):
            divided[level] = np.union1d(divided[level], _cells_meeting(region, level))
    if triangles is not None:
        touched = _touched_by_triangles(triangles, depth, divided)
    else:
        touched = _holding_points(np.zeros((0, 3)) if points is None else points, deepest)
    for level in range(depth):
        divided[level] = np.union1d(divided[level], touched[level])
    if balance:
        divided = balanced(divided)
    # Each division puts eight cells in the place of one.
    _require_few(1 + 7 * sum(len(codes) for codes in divided))
    tree = tree_of(divided)
    levels = tree.levels
    full = np.zeros(len(tree.size), dtype=bool)
    for here in range(deepest + 1):
        at = np.flatnonzero(levels == here)
        full[at] = np.isin(tree.codes[at] >> 3 * (deepest - here), touched[here])
    return ModelTree(tree, full)


def balanced(divided: Sequence[Ints]) -> list[Ints]:
    """Divide further cells, so that cells that touch differ by at most one level.

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
    """The octree in which given cells, and all their ancestors, are divided.

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


def _require_few(least: int, region: int | None = None) -> None:
    if least > MAX_CELLS:
        raise TooManyCells(least, region)


def _span(region: Region, level: int) -> tuple[Ints, Ints]:
    """The first (3,) cells of a level whose interior meets a region, and those after the last."""
    count = 1 << level
    # A side of a region that lies on a side of a cell, within rounding, ends there.
    low = np.floor(region.low * count + TOUCH).clip(0, count).astype(np.int64)
    high = np.ceil(region.high * count - TOUCH).clip(0, count).astype(np.int64)
    return low, high


def _number_meeting(region: Region, level: int) -> int:
    low, high = _span(region, level)
    return int(np.prod(high - low))


def _cells_meeting(region: Region, level: int) -> Ints:
    """Codes of the cells of a level whose interior meets a region."""
    axes = [np.arange(first, last) for first, last in zip(*_span(region, level), strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.unique(interleave(cells))


def _holding_points(points: Floats, depth: int) -> list[Ints]:
    """Codes, per level, of the cells that hold a point; the upper sides of the box are included."""
    beyond = np.any((points < 0) | (points > 1), axis=1)
    count = 1 << depth
    cells = np.floor(points[~beyond] * count).astype(np.int64).clip(0, count - 1)
    finest = np.unique(interleave(cells))
    return [np.unique(finest >> 3 * (depth - level)) for level in range(depth + 1)]


def _touched_by_triangles(triangles: Floats, depth: int, divided: Sequence[Ints]) -> list[Ints]:
    """Codes, per level, of the cells that triangles touch.

    Below ``depth`` only cells inside divided ones are tested.
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
        # Triangles smaller than the cells get the exact test only on the levels that count.
        meets = np.ones(len(owner), dtype=bool)
        asked = np.flatnonzero((extent[owner] > side) | (level >= depth))
        for start in range(0, len(asked), _CHUNK):
            part = asked[start : start + _CHUNK]
            corners = triangles[owner[part]]
            held = (corners >= low[part, None]) & (corners <= high[part, None])
            # A triangle without a corner in the cell may still pass through it.
            part = part[~np.any(np.all(held, axis=2), axis=1)]
            t = owner[part]
            meets[part] = touches_boxes(triangles[t], normals[t], edges[t], low[part], high[part])
        owner, code = owner[meets], code[meets]
        touched.append(np.unique(code))
        if level < depth:
            _require_few(8 * len(touched[level]))
        if depth <= level < deepest:
            inner = np.isin(code, divided[level])
            owner, code = owner[inner], code[inner]
        owner = np.repeat(owner, 8)
        code = ((code << 3)[:, None] + np.arange(8)).ravel()
    # A cell is touched where one of its parts is.
    for level in range(depth, 0, -1):
        touched[level - 1] = np.unique(touched[level] >> 3)
    return touched
