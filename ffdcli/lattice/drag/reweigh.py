"""Least change of weights that takes points of a rational volume to their targets.

``D(S) = T`` is linear in the weights: ``sum w_i N_i(S) (P_i - T) = 0`` (the dual that Hu 2001,
section 3, leaves out). All weights zero satisfy it, so each weight keeps at least a hundredth of
its old value. The least change under these bounds is a small convex quadratic program. It is solved
as a least-distance problem by non-negative least squares (Lawson and Hanson, Solving Least Squares
Problems, 1974, chapter 23), and then exactly on the set of active bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats

# Fraction of its old value that each weight keeps at least.
FLOOR = 0.01
# Singular values of the constraints below this fraction of the largest count as zero.
_NONE = 1e-10
# Squared residual below which a least-distance problem counts as having no solution; with a
# solution x the residual is 1 / (1 + |x|^2), with x in units of the mean weight.
_EMPTY = 1e-13
_MOST_POLISHES = 50


@dataclass(frozen=True)
class Reweighed:
    """Weights that take points to targets, or as close as possible.

    Parameters
    ----------
    weights : (n,) float64
    met : bool
        False if no weights within the bounds reach all targets; ``weights`` then have the least
        sum of squares of ``sum w N (P - T)``.
    beyond : (m,) float64
        Distance of each target from the convex hull of the control points that reach its source,
        0 inside; all 0 if the targets are met.
    """

    weights: Floats
    met: bool
    beyond: Floats


def reweigh(
    basis: csr_array, points: Floats, weights: Floats, free: Bools, targets: Floats
) -> Reweighed:
    """The weights nearest to the given ones for which the image of each source is its target.

    Parameters
    ----------
    basis : (m, n) sparse
        Polynomial basis functions at the sources.
    points : (n, 3) float64
    weights : (n,) float64
        Positive.
    free : (n,) bool
        Weights that may change.
    targets : (m, 3) float64
    """
    from scipy.optimize import lsq_linear

    columns = np.unique(basis.indices)
    dense = basis[:, columns].toarray()
    open_to_change = free[columns]
    unit = float(weights[columns].mean())
    old = weights[columns] / unit
    offsets = points[columns] - targets[:, None, :]
    size = np.abs(offsets).max(initial=0.0) or 1.0
    matrix = (dense[:, :, None] * offsets / size).transpose(0, 2, 1).reshape(-1, len(columns))
    # Rows of equal size, for one tolerance.
    matrix /= np.repeat(dense @ old, 3)[:, None]
    open_matrix, wanted = matrix[:, open_to_change], -matrix @ old
    lower = -(1 - FLOOR) * old[open_to_change]
    change = _least_change(open_matrix, wanted, lower)
    met = change is not None
    if change is None:
        # Older versions of scipy fail without unknowns.
        nothing = np.zeros(0)
        change = lsq_linear(open_matrix, wanted, (lower, np.inf)).x if len(lower) else nothing
    out = weights.copy()
    chosen = columns[open_to_change]
    floor = FLOOR * weights[chosen]
    out[chosen] = np.where(
        change <= lower, floor, np.maximum(weights[chosen] + unit * change, floor)
    )
    beyond = np.zeros(len(targets))
    if not met:
        beyond = np.array(
            [_distance_to_hull(o[n > 0]) for o, n in zip(offsets, dense, strict=True)]
        )
    return Reweighed(out, met, beyond)


def _least_change(matrix: Floats, wanted: Floats, lower: Floats) -> Floats | None:
    """The shortest x (t,) with ``matrix x = wanted`` and ``x >= lower``, or None.

    ``lower`` (t,) is negative, so that 0 is within the bounds.
    """
    from scipy.optimize import nnls

    left, values, right = np.linalg.svd(matrix, full_matrices=True)
    rank = int((values > _NONE * values.max(initial=0.0)).sum())
    shortest = right[:rank].T @ ((left[:, :rank].T @ wanted) / values[:rank])
    if np.abs(matrix @ shortest - wanted).max(initial=0.0) > _NONE:
        return None
    active = np.zeros(len(lower), dtype=bool)
    if np.any(shortest < lower):
        # x = shortest + Z y, so the least |x| is the least |y| with Z y >= lower - shortest.
        system = np.vstack([right[rank:], lower - shortest])
        aim = np.zeros(len(system))
        aim[-1] = 1.0
        duals, _ = nnls(system, aim, maxiter=30 * len(lower))
        residual = system @ duals - aim
        if float(residual @ residual) < _EMPTY:
            return None
        active = duals > 0
    return _polish(matrix, wanted, lower, active)


def _polish(matrix: Floats, wanted: Floats, lower: Floats, active: Bools) -> Floats:
    """The shortest x with active bounds met exactly; corrects the set of active bounds."""
    tolerance = 1e-12
    out = lower.copy()
    for _ in range(_MOST_POLISHES):
        out = lower.copy()
        inner = matrix[:, ~active]
        # Solve, then one step of iterative refinement.
        out[~active] = 0.0
        for _ in range(2):
            left_over = wanted - matrix @ out
            out[~active] += np.linalg.lstsq(inner, left_over, rcond=_NONE)[0]
        prices = np.linalg.lstsq(inner.T, out[~active], rcond=_NONE)[0]
        slack = out - matrix.T @ prices
        released = active & (slack < -tolerance)
        crossed = ~active & (out < lower - tolerance)
        if not released.any() and not crossed.any():
            break
        active = (active & ~released) | crossed
    return np.maximum(out, lower)


def _distance_to_hull(offsets: Floats) -> float:
    """Distance of the origin from the convex hull of points (t, 3)."""
    from scipy.optimize import nnls

    size = float(np.abs(offsets).max(initial=0.0)) or 1.0
    system = np.vstack([offsets.T / size, np.ones(len(offsets))])
    shares, _ = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]), maxiter=30 * len(offsets))
    nearest = float(np.linalg.norm(offsets.T @ shares) / shares.sum())
    return nearest if nearest > 1e-9 * size else 0.0
