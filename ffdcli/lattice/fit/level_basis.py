"""Functions of hierarchical lattices for fits, level by level, and their bending energy.

In a cell the displacement is a polynomial. It is written in the functions of one level alone: those
of coarser levels are sums of finer ones, by halving. So all products over cells are small matrices
of one level's functions, and what a control point of any level does is a matrix ``expand``.
"""

from __future__ import annotations

from itertools import pairwise, product
from math import comb

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, vstack

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows, run_starts
from ffdcli.lattice.fit.basis import FitBasis, GridPart
from ffdcli.lattice.fit.cholesky import dependent, dissect
from ffdcli.lattice.fit.grid import Grid
from ffdcli.volume.adaptive.hierarchical import active_functions
from ffdcli.volume.adaptive.octree import Octree
from ffdcli.volume.adaptive.volume import AdaptiveVolume


def level_basis(volume: AdaptiveVolume, box: Floats, places: Floats, free: Bools) -> FitBasis:
    """The functions of a hierarchical volume for a fit.

    Control points whose effect in the box others of the next level can give as well are left out:
    the rest are independent.

    Parameters
    ----------
    box : (2, 3) float64
        The lattice box.
    places : (m, 3) float64
        Pairs, in the lattice box.
    free : (n,) bool
        Control points that may move.
    """
    cells, first = _inner_cells(volume, box)
    degrees, depth = volume.degrees, cells.depth
    indices, levels = active_functions(cells, degrees)
    grids = [Grid(degrees, indices[levels == level]) for level in range(depth + 1)]
    # Where each control point is among the functions of its level.
    place = np.empty(len(first), dtype=np.int64)
    for level, grid in enumerate(grids):
        at = volume.levels == level
        place[at] = grid.find(first[at])
    supports = np.stack(volume.supports(), axis=1)
    kept = free & ~_replaceable(grids, volume.levels, place, free)
    kept[kept] = ~_dependent(grids, volume.levels, place, free, kept, supports)
    unknowns = np.flatnonzero(kept)
    expand = _expand(grids, volume.levels[unknowns], place[unknowns])
    parts = _parts(grids, cells, box, places)
    return FitBasis(parts, expand, unknowns, supports[unknowns], len(places))


def _inner_cells(volume: AdaptiveVolume, box: Floats) -> tuple[Octree, Ints]:
    """Polynomial cells of the box as an octree, and the first cell (n, 3) of each function."""
    tree = volume.functions.tree
    levels = volume.levels
    extent = np.rint((box[1] - box[0]) / volume.unit).astype(np.int64)
    depth = int(extent[0]).bit_length() - 1
    shift = np.rint((box[0] - volume.origin) / volume.unit).astype(np.int64)
    low = tree.low - shift
    inside = np.all((low >= 0) & (tree.high - shift <= 1 << depth), axis=1)
    first = (volume.functions.low - shift) >> (depth - levels)[:, None]
    return Octree(depth, low[inside], tree.size[inside]), first


def _halving(degree: int) -> Floats:
    """(k + 2,) weights of the functions of half the cell size that a B-spline is the sum of."""
    return np.array([comb(degree + 1, j) for j in range(degree + 2)]) / 2.0**degree


def _replaceable(grids: list[Grid], levels: Ints, place: Ints, free: Bools) -> Bools:
    """(n,) control points whose halves that reach the box are all free control points."""
    out = np.zeros(len(levels), dtype=bool)
    for level, (grid, finer) in enumerate(pairwise(grids)):
        loose = np.zeros(len(finer.first) + 1, dtype=bool)
        loose[place[free & (levels == level + 1)]] = True
        at = np.flatnonzero(levels == level)
        index = grid.first[place[at]]
        whole = np.ones(len(at), dtype=bool)
        least, most = -np.array(grid.degrees), (2 << level) - 1
        for step in product(*(range(k + 2) for k in grid.degrees)):
            half = 2 * index + step
            reaches = np.all((half >= least) & (half <= most), axis=1)
            # The last entry of `loose` stands for functions that are not there.
            whole &= ~reaches | loose[finer.find(half)]
        out[at] = whole
    return out


def _dependent(
    grids: list[Grid], levels: Ints, place: Ints, free: Bools, kept: Bools, supports: Floats
) -> Bools:
    """Those of the control points ``kept`` that others of their level and finer ones replace.

    They differ from these only by halves that are free control points. The other halves are
    independent, so that dependence of their sums decides.
    """
    out = np.zeros(len(levels), dtype=bool)
    for level, (grid, finer) in enumerate(pairwise(grids)):
        at = np.flatnonzero(kept & (levels == level))
        if not len(at):
            continue
        loose = np.zeros(len(finer.first) + 1, dtype=bool)
        loose[place[free & (levels == level + 1)]] = True
        coarse = Grid(grid.degrees, grid.first[place[at]])
        halves = _halves(coarse.first, grid.degrees, (2 << level) - 1)
        others = Grid(grid.degrees, halves[~loose[finer.find(halves)]])
        rows = _halved(coarse, others)
        out[at] = dependent(csr_array(rows.T @ rows), dissect(supports[at]))
    return out[kept]


def _halves(first: Ints, degrees: tuple[int, int, int], most: int) -> Ints:
    """The functions of half the cell size, each once, that functions (n, 3) consist of.

    Only those that reach the box: along each axis up to number ``most``.
    """
    steps = np.indices([k + 2 for k in degrees]).reshape(3, -1).T
    found = np.unique((2 * first[:, None] + steps).reshape(-1, 3), axis=0)
    return found[np.all((found >= -np.array(degrees)) & (found <= most), axis=1)]


def _expand(grids: list[Grid], levels: Ints, place: Ints) -> csr_array:
    """(f, n) coefficients of the functions of all levels for a unit move of each unknown."""
    count = len(levels)
    blocks: list[csr_array] = []
    for level, grid in enumerate(grids):
        at = np.flatnonzero(levels == level)
        own = csr_array((np.ones(len(at)), (place[at], at)), shape=(len(grid.first), count))
        blocks.append(own if level == 0 else own + _halved(grids[level - 1], grid) @ blocks[-1])
    return csr_array(vstack(blocks, format="csr"))


def _halved(coarse: Grid, fine: Grid) -> csr_array:
    """(f, g) coefficients of the functions of a level for each function of the coarser one."""
    rows, columns, values = [], [], []
    weights = [_halving(k) for k in coarse.degrees]
    for step in product(*(range(k + 2) for k in coarse.degrees)):
        even = np.flatnonzero(np.all((fine.first - step) % 2 == 0, axis=1))
        parent = coarse.find((fine.first[even] - step) // 2)
        rows.append(even[parent >= 0])
        columns.append(parent[parent >= 0])
        values.append(
            np.full(len(rows[-1]), np.prod([w[j] for w, j in zip(weights, step, strict=True)]))
        )
    entries = (np.concatenate(rows), np.concatenate(columns))
    shape = (len(fine.first), len(coarse.first))
    return csr_array((np.concatenate(values), entries), shape=shape)


def _parts(grids: list[Grid], cells: Octree, box: Floats, places: Floats) -> list[GridPart]:
    """The pairs and cells of each level."""
    degrees, depth, extent = grids[0].degrees, cells.depth, box[1] - box[0]
    share = (places - box[0]) / extent
    finest = np.floor(share * (1 << depth)).astype(np.int64).clip(0, (1 << depth) - 1)
    leaf = cells.locate(finest)
    levels, leaf_levels = cells.levels[leaf], cells.levels
    parts = []
    for level, grid in enumerate(grids):
        pairs = np.flatnonzero(levels == level)
        index = finest[pairs] >> (depth - level)
        held, owner = distinct_rows(index)
        order = np.argsort(owner, kind="stable")
        local = share[pairs[order]] * (1 << level) - index[order]
        u, v, w = (_uniform(k)(local[:, axis]) for axis, k in enumerate(degrees))
        values = np.einsum("mi,mj,mk->mijk", u, v, w).reshape(len(pairs), len(grid.offsets))
        starts = run_starts(np.bincount(owner, minlength=len(held)))
        here = cells.low[leaf_levels == level] >> (depth - level)
        energy = grid.sums(here - degrees, _cell_energy(degrees, extent, level))
        parts.append(GridPart(grid, held - degrees, pairs[order], starts, values, energy))
    return parts


def _uniform(degree: int) -> BSpline:
    """The ``degree + 1`` uniform B-splines on the cell from 0 to 1."""
    return BSpline(np.arange(-degree, degree + 2.0), np.eye(degree + 1), degree)


def _cell_energy(degrees: tuple[int, int, int], extent: Floats, level: int) -> Floats:
    """(q, q) bending energy over a cell of a level of the functions that reach it."""
    axes = []
    for degree, length in zip(degrees, extent / (1 << level), strict=True):
        nodes, shares = np.polynomial.legendre.leggauss(degree + 1)
        every = _uniform(degree)
        rows = [every.derivative(order)((1 + nodes) / 2) for order in range(3)]
        axes.append([(r.T * shares / 2) @ r * length ** (1 - 2 * n) for n, r in enumerate(rows)])
    unit = float(extent @ extent) ** 2 / float(extent.prod())
    total: Floats = np.zeros((1, 1))
    for orders in np.ndindex(3, 3, 3):
        if sum(orders) == 2:
            u, v, w = (axes[axis][order] for axis, order in enumerate(orders))
            # A mixed derivative is an entry of the matrix of second derivatives twice.
            total = total + (1 if max(orders) == 2 else 2) * unit * np.kron(u, np.kron(v, w))
    return total
