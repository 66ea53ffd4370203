"""Functions of one grid of cells: which reach a cell, and sums over cells of their products."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Floats, Ints, run_starts

# Cells whose products are summed together: bounds the memory.
_CHUNK = 1000


@dataclass(frozen=True)
class Grid:
    """B-splines of a grid of cells; function ``i`` reaches the cells ``i`` to ``i + k``.

    Parameters
    ----------
    degrees : (int, int, int)
    first : (f, 3) int64
        Number of each function along each axis, in lexical order; may be negative.
    """

    degrees: tuple[int, int, int]
    first: Ints

    @cached_property
    def _keys(self) -> Ints:
        return self._key(self.first)

    @cached_property
    def _span(self) -> tuple[Ints, Ints]:
        """Least number along each axis, and how many there are, with room for neighbours."""
        room = np.array(self.degrees)
        least = self.first.min(axis=0) - room
        return least, self.first.max(axis=0) + room + 1 - least

    def _key(self, index: Ints) -> Ints:
        least, count = self._span
        shifted = index - least
        return np.asarray(
            (shifted[..., 0] * count[1] + shifted[..., 1]) * count[2] + shifted[..., 2]
        )

    def find(self, index: Ints) -> Ints:
        """Number (...) of the functions at ``index`` (..., 3); -1 where there is none."""
        least, count = self._span
        inside = np.all((index >= least) & (index < least + count), axis=-1)
        keys = np.where(inside, self._key(index), -1)
        place = np.searchsorted(self._keys, keys).clip(0, len(self._keys) - 1)
        return np.where(self._keys[place] == keys, place, -1)

    @cached_property
    def offsets(self) -> Ints:
        """(q, 3) numbers of the functions that reach a cell, counted from the first."""
        return np.indices([k + 1 for k in self.degrees]).reshape(3, -1).T

    def reaching(self, cells: Ints) -> Ints:
        """Functions (c, q) that reach cells, given by the first function of each (c, 3)."""
        return self.find(cells[:, None] + self.offsets)

    def sums(self, cells: Ints, products: Floats | CellProducts) -> csr_array:
        """Sum (f, f) over cells (c, 3) of products of their functions.

        Parameters
        ----------
        cells : (c, 3) int64
            First function of each cell; each cell once.
        products : (q, q) float64, or CellProducts
            The same for all cells, or one matrix for each.
        """
        # Column of the table: the difference of the numbers of two functions.
        wide = [2 * k + 1 for k in self.degrees]
        strides = np.array([wide[1] * wide[2], wide[2], 1])
        middle = int(np.array(self.degrees) @ strides)
        code = self.offsets @ strides
        table = np.zeros(self._neighbours.shape)
        for start in range(0, len(cells), _CHUNK):
            part = np.arange(start, min(start + _CHUNK, len(cells)))
            rows = self.reaching(cells[part])
            found = products if isinstance(products, np.ndarray) else products.take(part)
            for a in range(len(code)):
                # Each row occurs once, so that nothing is lost.
                table[rows[:, a, None], code - code[a] + middle] += found[..., a, :]
        there = self._neighbours >= 0
        starts = run_starts(there.sum(axis=1))
        shape = (len(self.first), len(self.first))
        return csr_array((table[there], self._neighbours[there], starts), shape=shape)

    @cached_property
    def _neighbours(self) -> Ints:
        """(f, s) functions whose numbers differ by up to the degrees; -1 where there is none."""
        wide = [2 * k + 1 for k in self.degrees]
        around = np.indices(wide).reshape(3, -1).T - np.array(self.degrees)
        parts = np.array_split(self.first, 1 + len(self.first) // _CHUNK)
        return np.concatenate([self.find(part[:, None] + around) for part in parts])


@dataclass(frozen=True, eq=False)
class CellProducts:
    """For each cell, the sum over its points of the products of the functions there.

    Parameters
    ----------
    starts : (c + 1,) int64
        Points of cell ``i`` are those from ``starts[i]`` on.
    values : (p, q) float64
        Functions at the points.
    weights : (p,) float64
    """

    starts: Ints
    values: Floats
    weights: Floats

    def take(self, part: Ints) -> Floats:
        """Sums (c, q, q) of consecutive cells."""
        counts = np.diff(self.starts)[part]
        width = self.values.shape[1]
        out = np.zeros((len(part), width, width))
        # Cells with about as many points are treated together.
        size = np.where(counts > 0, 1 << np.ceil(np.log2(counts.clip(1))).astype(np.int64), 0)
        for each in np.unique(size[size > 0]):
            cells = np.flatnonzero(size == each)
            for some in np.array_split(cells, 1 + len(cells) * int(each) // 100_000):
                place = self.starts[part[some], None] + np.arange(each)
                live = np.arange(each) < counts[some, None]
                place = np.where(live, place, 0)
                rows = self.values[place]
                weighted = rows * np.where(live, self.weights[place], 0.0)[..., None]
                out[some] = np.swapaxes(weighted, 1, 2) @ rows
        return out
