"""Uniform B-splines of several levels on nested dyadic grids of the unit cube.

These are the functions of :mod:`ffdcli.volume.adaptive.hierarchical`, chosen per level, with fast
evaluation at points, before a volume is made of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, hstack

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.volume.adaptive.octree import interleave, separate

# By level, the increasing Morton codes of cells of that level.
CellCodes = dict[int, Ints]

# No side of the cube, lower and upper, at which functions must vanish.
OPEN: Bools = np.zeros((2, 3), dtype=bool)

# Points evaluated together: bounds the memory.
_CHUNK = 20_000


@dataclass(frozen=True)
class Functions:
    """Chosen functions of some levels.

    Parameters
    ----------
    degree : int
        Degree along all axes.
    keys : dict of int to (n,) int64
        By level, increasing: the first cell ``i, j, l`` of each function's support as one number.
    """

    degree: int
    keys: CellCodes

    @property
    def count(self) -> int:
        """Number of functions."""
        return sum(map(len, self.keys.values()))

    @property
    def firsts(self) -> tuple[Ints, Ints]:
        """First cells (n, 3) of the supports, in units of their level, and the levels (n,)."""
        firsts, levels = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for level, keys in self.keys.items():
            firsts.append(_first_cells(level, keys, self.degree))
            levels.append(np.full(len(keys), level))
        return np.concatenate(firsts), np.concatenate(levels)

    @property
    def order(self) -> Ints:
        """(n,) order of the functions, by Morton code, that keeps neighbours close together."""
        firsts, levels = self.firsts
        shift = max(self.keys, default=0) - levels
        return np.argsort(interleave((firsts + self.degree) << shift[:, None]), kind="stable")

    def matrix(self, places: Floats) -> csr_array:
        """(m, n) sparse values of the functions at points (m, 3) of the unit cube."""
        found = [csr_array((len(places), 0))]
        for level, keys in self.keys.items():
            found.append(self._of_level(level, keys, places))
        return csr_array(hstack(found, format="csr"))

    def _of_level(self, level: int, keys: Ints, places: Floats) -> csr_array:
        rows, columns, values = [], [], []
        for start in range(0, max(1, len(places)), _CHUNK):
            some = places[start : start + _CHUNK]
            cells = cells_of(some, level)
            share = some * 2**level - cells
            u, v, w = (_values(share[:, axis], self.degree) for axis in range(3))
            grid = u[:, :, None, None] * v[:, None, :, None] * w[:, None, None, :]
            value = grid.reshape(len(some), (self.degree + 1) ** 3)
            asked = _keys(cells, level, self.degree)
            at = np.searchsorted(keys, asked).clip(0, len(keys) - 1)
            row, column = np.nonzero(keys[at] == asked)
            rows.append(row + start)
            columns.append(at[row, column])
            values.append(value[row, column])
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csr_array(entries, shape=(len(places), len(keys)))


def functions_on(cells: CellCodes, degree: int, closed: Bools = OPEN) -> Functions:
    """All functions of each level that reach its cells; they span all polynomials there.

    Without those that reach out of the cube at its ``closed`` sides, (2, 3) bool: lower and upper.
    """
    keys = {
        level: np.unique(_keys(separate(codes), level, degree))
        for level, codes in cells.items()
        if len(codes)
    }
    if closed.any():
        keys = {level: _within(level, of_level, degree, closed) for level, of_level in keys.items()}
    return Functions(degree, {level: of_level for level, of_level in keys.items() if len(of_level)})


def cells_of(places: Floats, level: int) -> Ints:
    """(m, 3) cells of a level that hold points (m, 3) of the unit cube."""
    count = 1 << level
    return np.floor(places * count).astype(np.int64).clip(0, count - 1)


def codes_of(places: Floats, level: int) -> Ints:
    """(m,) Morton codes of the cells of a level that hold points (m, 3)."""
    return interleave(cells_of(places, level))


def around(codes: Ints, level: int, reach: int) -> Ints:
    """Codes of the cells within ``reach`` cells of given ones, these included."""
    cells = separate(codes)
    for axis in range(3):
        step = np.zeros(3, dtype=np.int64)
        step[axis] = 1
        moved = cells[:, None] + np.arange(-reach, reach + 1)[:, None] * step
        inside = moved[np.all((moved >= 0) & (moved < 1 << level), axis=2)]
        cells = separate(np.unique(interleave(inside)))
    return interleave(cells)


def _within(level: int, keys: Ints, degree: int, closed: Bools) -> Ints:
    """The functions of a level whose supports stay in the cube at its closed sides."""
    first = _first_cells(level, keys, degree)
    beyond = (closed[0] & (first < 0)) | (closed[1] & (first + degree + 1 > 1 << level))
    return keys[~beyond.any(axis=1)]


def _first_cells(level: int, keys: Ints, degree: int) -> Ints:
    """(n, 3) first cells of supports, from ``-degree`` on."""
    width = _width(level, degree)
    return np.stack([keys // width**2, keys // width % width, keys % width], axis=-1) - degree


def _width(level: int, degree: int) -> int:
    return (1 << level) + degree


def _keys(cells: Ints, level: int, degree: int) -> Ints:
    """(m, (k + 1)**3) keys of the functions that reach cells (m, 3)."""
    width = _width(level, degree)
    steps = np.arange(degree + 1)
    first = (steps[:, None, None] * width + steps[:, None]) * width + steps
    corner = (cells[:, 0] * width + cells[:, 1]) * width + cells[:, 2]
    return np.asarray(corner[:, None] + first.ravel())


def _values(share: Floats, degree: int) -> Floats:
    """(m, k + 1) uniform B-splines at shares (m,) of a cell, in order of their supports."""
    values = np.ones((len(share), 1))
    for k in range(1, degree + 1):
        into = share[:, None] + np.arange(k - 1, -1, -1)
        grown = np.zeros((len(share), k + 1))
        grown[:, 1:] += values * into / k
        grown[:, :-1] += values * (k - into) / k
        values = grown
    return values
