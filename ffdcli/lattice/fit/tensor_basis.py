"""Functions of tensor-product lattices for fits, and their bending energy."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, eye_array, kron

from ffdcli.arrays import Floats, Ints, distinct_rows, run_starts
from ffdcli.lattice.fit.basis import FitBasis, GridPart
from ffdcli.lattice.fit.grid import Grid
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.weights import rational_basis


def tensor_basis(
    volume: BSplineVolume, weights: Floats, places: Floats, unknowns: Ints
) -> FitBasis:
    """The functions of a B-spline volume for a fit.

    With weights (nu, nv, nw) that differ the functions are rational; the energy is that of the
    polynomials without weights.

    Parameters
    ----------
    places : (m, 3) float64
        Pairs, in the lattice box.
    unknowns : (n,) int64
        Control points that may move, numbered w fastest.
    """
    rows = rational_basis(volume.basis_matrix(places), weights.ravel())
    spans = volume.cells(places) - np.array(volume.degrees)
    cells, owner = distinct_rows(spans)
    order = np.argsort(owner, kind="stable")
    values = rows.data.reshape(len(places), -1)
    grid = Grid(volume.degrees, np.indices(volume.shape).reshape(3, -1).T)
    starts = run_starts(np.bincount(owner, minlength=len(cells)))
    part = GridPart(grid, cells, order, starts, values[order], _energy(volume))
    chosen = csr_array(eye_array(len(grid.first), format="csc")[:, unknowns])
    # In knots; a jump of a slope joins functions that only touch.
    reach = [
        k + 1 + int(bool(len(_creases(knots, k))))
        for knots, k in zip(volume.knots, volume.degrees, strict=True)
    ]
    supports = np.stack([grid.first, grid.first + reach], axis=1).astype(np.float64)
    return FitBasis((part,), chosen, unknowns, supports[unknowns], len(places))


def _energy(volume: BSplineVolume) -> csr_array:
    """(f, f) bending energy of all functions."""
    axes = [
        [_products(knots, degree, order) for order in range(3)]
        for knots, degree in zip(volume.knots, volume.degrees, strict=True)
    ]
    extent = volume.box[1] - volume.box[0]
    unit = float(extent @ extent) ** 2 / float(extent.prod())
    total = csr_array((int(np.prod(volume.shape)),) * 2)
    for orders in np.ndindex(3, 3, 3):
        if sum(orders) == 2:
            u, v, w = (axes[axis][order] for axis, order in enumerate(orders))
            # A mixed derivative is an entry of the matrix of second derivatives twice.
            total = total + (1 if max(orders) == 2 else 2) * unit * kron(u, kron(v, w))
    return csr_array(total)


def _products(knots: Floats, degree: int, order: int) -> csr_array:
    """(n, n) integrals over the box of products of derivatives of B-splines on one axis.

    Where a second derivative is a jump of the slope, the jump counts as spread over the cells
    beside it.
    """
    count = len(knots) - degree - 1
    breaks = np.unique(knots[degree : count + 1])
    nodes, shares = np.polynomial.legendre.leggauss(degree + 1)
    half = np.diff(breaks)[:, None] / 2
    at = (breaks[:-1, None] + half * (1 + nodes)).ravel()
    every = BSpline(knots, np.eye(count), degree)
    rows = every(at, nu=order)
    found = rows.T @ ((half * shares).ravel()[:, None] * rows)
    if order == 2:
        for number in _creases(knots, degree):
            before, knot, after = breaks[number - 1 : number + 2]
            # The slope is a polynomial on both sides, so its ends come from inside.
            jump = _slope_end(every, knot, after) - _slope_end(every, knot, before)
            found += np.outer(jump, jump) * 2 / (after - before)
    return csr_array(found)


def _creases(knots: Floats, degree: int) -> Ints:
    """Numbers of the breaks inside the box where slopes may jump."""
    times = np.unique(knots[degree : len(knots) - degree], return_counts=True)[1]
    return np.flatnonzero(times[1:-1] >= degree) + 1


def _slope_end(every: BSpline, knot: float, beyond: float) -> Floats:
    """Slopes (n,) at a knot, continued from the cell between it and ``beyond``."""
    nodes = np.linspace(0.25, 0.75, every.k + 1)
    weights = [
        np.prod([-other / (node - other) for other in nodes if other != node]) for node in nodes
    ]
    return np.asarray(np.array(weights) @ every(knot + nodes * (beyond - knot), nu=1))
