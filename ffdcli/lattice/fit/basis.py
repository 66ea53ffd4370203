"""The functions that a fit combines, at its pairs, and their bending energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import block_diag, csr_array

from ffdcli.arrays import Floats, Ints, run_starts
from ffdcli.lattice.fit.grid import CellProducts, Grid


@dataclass(frozen=True, eq=False)
class GridPart:
    """Functions of one grid, and the pairs in its cells.

    Parameters
    ----------
    grid : Grid
    cells : (c, 3) int64
        First function of each cell that holds pairs; each cell once.
    pairs : (p,) int64
        Numbers of the pairs, cell by cell.
    starts : (c + 1,) int64
        Pairs of cell ``i`` are those from ``starts[i]`` on.
    values : (p, q) float64
        Functions that reach the cell, at the pairs.
    energy : (f, f) sparse
        Bending energy of the functions over the cells of this grid.
    """

    grid: Grid
    cells: Ints
    pairs: Ints
    starts: Ints
    values: Floats
    energy: csr_array

    @cached_property
    def columns(self) -> Ints:
        """(p, q) numbers of the functions in ``values``."""
        return np.repeat(self.grid.reaching(self.cells), np.diff(self.starts), axis=0)

    def products(self, weights: Floats) -> csr_array:
        """Weighted sum (f, f) over the pairs of the products of the functions."""
        products = CellProducts(self.starts, self.values, weights[self.pairs])
        return self.grid.sums(self.cells, products)


@dataclass(frozen=True, eq=False)
class FitBasis:
    """Functions that a fit combines.

    Parameters
    ----------
    parts : sequence of GridPart
        Each pair is in one of them.
    expand : (f, n) sparse
        Coefficients of the functions of all parts for a unit move of each unknown.
    unknowns : (n,) int64
        Control points that are solved for.
    supports : (n, 2, 3) float64
        Boxes, in any units: unknowns whose boxes do not overlap share no cell.
    count : int
        Number of pairs.
    """

    parts: Sequence[GridPart]
    expand: csr_array
    unknowns: Ints
    supports: Floats
    count: int

    @cached_property
    def values(self) -> csr_array:
        """(m, f) functions at the pairs."""
        first = run_starts(np.array([len(part.grid.first) for part in self.parts]))
        order = np.concatenate([part.pairs for part in self.parts])
        columns = [part.columns + start for part, start in zip(self.parts, first, strict=False)]
        column = np.concatenate(columns).ravel()
        value = np.concatenate([part.values for part in self.parts])
        starts = np.arange(len(order) + 1) * value.shape[1]
        found = csr_array((value.ravel(), column, starts), shape=(len(order), int(first[-1])))
        return csr_array(found[np.argsort(order)])

    @cached_property
    def energy(self) -> csr_array:
        """(n, n) bending energy of the unknowns.

        It is the mean over the box of the squared second derivatives, times the fourth power of
        the diagonal of the box.
        """
        return self._of_unknowns([part.energy for part in self.parts])

    def products(self, weights: Floats) -> csr_array:
        """Weighted sum (n, n) over the pairs of the products of the unknowns' functions."""
        return self._of_unknowns([part.products(weights) for part in self.parts])

    def _of_unknowns(self, blocks: list[csr_array]) -> csr_array:
        whole = csr_array(block_diag(blocks, format="csr"))
        return csr_array(self.expand.T.tocsr() @ whole @ self.expand)

    def at_pairs(self, moves: Floats) -> Floats:
        """Displacements (m, c) at the pairs for moves (n, c) of the unknowns."""
        return np.asarray(self.values @ (self.expand @ moves))

    def to_unknowns(self, amounts: Floats) -> Floats:
        """The transpose of :meth:`at_pairs`: (n, c) for amounts (m, c)."""
        return np.asarray(self.expand.T @ (self.values.T @ amounts))
