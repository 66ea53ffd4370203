"""The octree in whose leaves products of B-splines are polynomials."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Ints, distinct_rows, places_in_runs
from ffdcli.volume.adaptive.octree import Octree, interleave
from ffdcli.volume.adaptive.octree_growth import tree_of

# Places of knot planes looked at together for each leaf allowed: supports overlap.
_OVERLAP = 16


class TooManyPieces(ValueError):
    """Functions need more polynomial cells than are allowed: ``least`` or more."""

    def __init__(self, least: int) -> None:
        super().__init__(f"{least:,} polynomial cells or more")
        self.least = least


def polynomial_cells(knots: tuple[Ints, Ints, Ints], depth: int, most: int | None = None) -> Octree:
    """The coarsest octree without knots inside its leaves.

    Parameters
    ----------
    knots : three (n, k_a + 2) int64
        Knots of n functions in finest units; those beyond ``0 .. 2**depth`` are ignored.
    depth : int
    most : int, optional
        Largest number of leaves; None where they are known to be few.

    Raises
    ------
    TooManyPieces
        Before any of them is made.
    """
    top = 1 << depth
    low = np.stack([t[:, 0] for t in knots], axis=-1).clip(0, top)
    high = np.stack([t[:, -1] for t in knots], axis=-1).clip(0, top)
    codes: list[list[Ints]] = [[] for _ in range(depth)]
    for axis in range(3):
        others = [(axis + 1) % 3, (axis + 2) % 3]
        # Cells on a knot plane are at most as large as the largest power of two that divides it.
        count = knots[axis].shape[1]
        sheet = np.column_stack(
            [
                knots[axis].reshape(-1),
                np.repeat(low[:, others], count, axis=0),
                np.repeat(high[:, others], count, axis=0),
            ]
        )
        sheet, _ = distinct_rows(sheet[(sheet[:, 0] > 0) & (sheet[:, 0] < top)])
        power = sheet[:, 0] & -sheet[:, 0]
        for level in range(depth):
            side = 1 << (depth - level)
            # The plane passes through the middle of cells of this side: they are divided.
            rows = sheet[power == side >> 1]
            first = rows[:, 1:3] // side
            last = -(-rows[:, 3:5] // side)
            places = int((last - first).prod(axis=1).sum())
            if most is not None and places > _OVERLAP * most:
                raise TooManyPieces(most + 1)
            owner, place = _rectangles(first, last)
            cells = np.empty((len(owner), 3), dtype=np.int64)
            cells[:, axis] = rows[owner, 0] // side
            cells[:, others] = place
            codes[level].append(np.unique(interleave(cells)))
    closed = [np.unique(np.concatenate(each)) for each in codes]
    # Each division of a cell adds seven.
    least = 1 + 7 * sum(map(len, closed))
    if most is not None and least > most:
        raise TooManyPieces(least)
    return tree_of(closed)


def _rectangles(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """All integer places (p, 2) of rectangles [first, last) (m, 2), with their owners (p,)."""
    size = last - first
    count = size[:, 0] * size[:, 1]
    owner = np.repeat(np.arange(len(first)), count)
    number = places_in_runs(count)
    place = np.stack([number // size[owner, 1], number % size[owner, 1]], axis=-1)
    return owner, first[owner] + place
