"""Values and tangents of B-spline curves and surfaces, in batches.

One evaluation serves space curves, pcurves and surfaces. Weights are a trailing coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bernstein import bernstein

# Points per pass: a bicubic-sextic patch takes about a kilobyte of poles per point.
CHUNK = 8192


@dataclass(frozen=True)
class CurveBatch:
    """Curves that share a degree and a multiplicity pattern.

    Parameters
    ----------
    owners : (m,) int64
        The edges or coedges the curves belong to.
    degree : int
    knots : (m, nb) float64
        Distinct knots of each curve.
    mults : (nb,) int64
    poles : (m, n, d) float64, or (m, n, d + 1) homogeneous where ``rational``
    rational : bool
    """

    owners: Ints
    degree: int
    knots: Floats
    mults: Ints
    poles: Floats
    rational: bool


@dataclass(frozen=True)
class SurfaceBatch:
    """Surfaces that share degrees and multiplicity patterns, one for each face in ``owners``.

    Parameters
    ----------
    owners : (m,) int64
    degrees : (int, int)
    u_knots, v_knots : (m, nbu), (m, nbv) float64
        Distinct knots.
    u_mults, v_mults : (nbu,), (nbv,) int64
    poles : (m, nu, nv, 3) float64, or (m, nu, nv, 4) homogeneous where ``rational``
    rational : bool
    """

    owners: Ints
    degrees: tuple[int, int]
    u_knots: Floats
    v_knots: Floats
    u_mults: Ints
    v_mults: Ints
    poles: Floats
    rational: bool


# First function that does not vanish (n,), values and slopes (n, degree + 1); see `basis`.
Basis = tuple[Ints, Floats, Floats]


def groups(keys: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield every key that occurs, with the indices where it does, in ascending order."""
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order])) + 1
    for part in np.split(order, cuts):
        if len(part):
            yield int(keys[part[0]]), part


def chunks(count: int, size: int = CHUNK) -> Iterator[slice]:
    """Yield slices that cover ``range(count)``, none longer than ``size``."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def sums(owner: Ints, amounts: Floats, count: int) -> Floats:
    """(count,) or (count, k) sums of the amounts (n,) or (n, k) that belong to each owner (n,)."""
    if amounts.ndim == 2:
        return np.stack([sums(owner, column, count) for column in amounts.T], axis=1)
    total: Floats = np.bincount(owner, weights=amounts, minlength=count).astype(np.float64)
    return total


def basis(degree: int, knots: Floats, mults: Ints, at: Floats) -> Basis:
    """Evaluate the basis functions that do not vanish, and their derivatives.

    Outside the knots the first or last polynomial is continued. At a knot the piece to its right
    applies, at the last knot the piece to its left.

    Parameters
    ----------
    degree : int
    knots : (n, nb) float64
        Distinct knots, one row for each parameter.
    mults : (nb,) int64
        Multiplicities; the end ones are ``degree + 1``.
    at : (n,) float64
        Parameters.

    Returns
    -------
    first : (n,) int64
        Index of the first function that does not vanish.
    values, slopes : (n, degree + 1) float64

    Notes
    -----
    Piegl and Tiller, The NURBS Book, algorithms A2.2 and A2.3.
    """
    if len(mults) == 2:
        length = knots[:, 1] - knots[:, 0]
        values, slopes = bernstein(degree, (at - knots[:, 0]) / length)
        return np.zeros(len(at), dtype=np.int64), values, slopes / length[:, None]
    flat = np.repeat(knots, mults, axis=1)
    piece = (at[:, None] >= knots[:, 1:-1]).sum(axis=1)
    span = np.cumsum(mults)[piece] - 1
    first = span - degree
    reach = first[:, None] + np.arange(1, 2 * degree + 1)
    near = np.ascontiguousarray(np.take_along_axis(flat, reach, axis=1).T)
    left = at - near[degree - 1 :: -1]
    right = near[degree:] - at
    values = np.zeros((degree + 1, len(at)))
    slopes = np.zeros_like(values)
    values[0] = 1.0
    for order in range(1, degree + 1):
        carried = np.zeros(len(at))
        for r in range(order):
            share = values[r] / (right[r] + left[order - 1 - r])
            values[r] = carried + right[r] * share
            carried = left[order - 1 - r] * share
            if order == degree:
                slopes[r] -= degree * share
                slopes[r + 1] += degree * share
        values[order] = carried
    return first, values.T, slopes.T


def project(homogeneous: Floats, slopes: Floats, rational: bool) -> tuple[Floats, Floats]:
    """Points and tangents from homogeneous ones; unchanged if not ``rational``.

    Parameters
    ----------
    homogeneous : (..., d) float64
    slopes : (..., q, d) float64
        Its derivatives along q parameters.
    """
    if not rational:
        return homogeneous, slopes
    weight = homogeneous[..., -1:]
    point = homogeneous[..., :-1] / weight
    tangents = slopes[..., :-1] - point[..., None, :] * slopes[..., -1:]
    return point, tangents / weight[..., None]


def curve_points(batch: CurveBatch, rows: Ints, at: Floats) -> tuple[Floats, Floats]:
    """Evaluate curves ``rows`` at parameters ``at``: points (n, d) and tangents (n, 1, d)."""
    size = batch.poles.shape[-1] - batch.rational
    points = np.empty((len(rows), size))
    tangents = np.empty((len(rows), 1, size))
    for part in chunks(len(rows)):
        row = rows[part]
        first, values, slopes = basis(batch.degree, batch.knots[row], batch.mults, at[part])
        if len(batch.mults) == 2:
            poles = batch.poles[row]
        else:
            poles = batch.poles[row[:, None], first[:, None] + np.arange(batch.degree + 1)]
        both = np.stack([values, slopes], axis=1) @ poles
        points[part], tangents[part] = project(both[:, 0], both[:, 1:], batch.rational)
    return points, tangents


def surface_points(batch: SurfaceBatch, rows: Ints, uv: Floats) -> tuple[Floats, Floats]:
    """Evaluate surfaces ``rows`` at parameters ``uv`` (n, 2): points (n, 3), tangents (n, 2, 3)."""
    size = batch.poles.shape[-1]
    points = np.empty((len(rows), size - batch.rational))
    tangents = np.empty((len(rows), 2, size - batch.rational))
    for part in chunks(len(rows)):
        (first_u, u, du), (first_v, v, dv) = _bases(batch, rows[part], uv[part])
        poles = _poles_of_points(batch, rows[part], first_u, first_v)
        along = np.stack([u, du], axis=1) @ poles.reshape(len(u), u.shape[1], -1)
        along = along.reshape(len(u), 2, v.shape[1], size)
        at_v = np.stack([v, dv], axis=1) @ along[:, 0]
        slope_u = (v[:, None, :] @ along[:, 1])[:, 0]
        slopes = np.stack([slope_u, at_v[:, 1]], axis=1)
        points[part], tangents[part] = project(at_v[:, 0], slopes, batch.rational)
    return points, tangents


def surface_positions(batch: SurfaceBatch, rows: Ints, uv: Floats) -> Floats:
    """The points of :func:`surface_points` alone: several times faster where rows come in runs."""
    size = batch.poles.shape[-1]
    found = np.empty((len(rows), size))
    for part in chunks(len(rows)):
        row = rows[part]
        (first_u, u, _), (first_v, v, _) = _bases(batch, row, uv[part])
        table = (u[:, :, None] * v[:, None]).reshape(len(row), -1)
        begins = np.arange(len(row))
        if _one_piece(batch):
            # One product for all points of a surface that follow each other.
            begins = np.flatnonzero(np.r_[True, row[1:] != row[:-1]])
        for length, which in groups(np.diff(np.r_[begins, len(row)])):
            first = begins[which]
            at = first[:, None] + np.arange(length)
            poles = _poles_of_points(batch, row[first], first_u[first], first_v[first])
            found[part][at] = table[at] @ poles.reshape(len(which), -1, size)
    return found[:, :-1] / found[:, -1:] if batch.rational else found


def _one_piece(batch: SurfaceBatch) -> bool:
    return len(batch.u_mults) == len(batch.v_mults) == 2


def _bases(batch: SurfaceBatch, row: Ints, uv: Floats) -> tuple[Basis, Basis]:
    return (
        basis(batch.degrees[0], batch.u_knots[row], batch.u_mults, uv[:, 0]),
        basis(batch.degrees[1], batch.v_knots[row], batch.v_mults, uv[:, 1]),
    )


def _poles_of_points(batch: SurfaceBatch, row: Ints, first_u: Ints, first_v: Ints) -> Floats:
    """(n, degree_u + 1, degree_v + 1, d) control points that reach a point of each surface."""
    if _one_piece(batch):
        return batch.poles[row]
    width_u, width_v = batch.degrees[0] + 1, batch.degrees[1] + 1
    return batch.poles[
        row[:, None, None],
        (first_u[:, None] + np.arange(width_u))[:, :, None],
        (first_v[:, None] + np.arange(width_v))[:, None, :],
    ]
