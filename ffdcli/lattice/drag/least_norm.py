"""Least-norm moves of control points that take points of the volume to their targets.

With ``B`` the basis matrix (a row per constraint, a column per control point), the shortest
``delta`` with ``B delta = d`` is ``delta = B^T M`` with ``(B B^T) M = d`` (Hu 2001, Eq. 12 and 16;
the pseudo-inverse solution of Hsu et al. 1992). A row has ``(k + 1)^3`` nonzeros, so only the size
of ``B B^T`` depends on the number of constraints, and nothing on that of control points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpocon
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats

# Constraints that need moves of control points longer than their displacements by this factor count
# as dependent or unreachable: the result would lose its accuracy in double precision.
_LEVERAGE = 1e8
# Largest condition of B B^T for Cholesky with refinement; above it B itself is decomposed.
_CHOLESKY_CONDITION = 1e12
# Largest condition for which one step of refinement is enough.
_REFINED_ONCE = 1e6
# Largest size of a dense matrix of constraints by control points: 800 MB.
_MAX_DENSE = 100_000_000


class TooManyConstraints(ValueError):
    """Dependent constraints that are too many for a decision on rank."""


@dataclass(frozen=True)
class Factored:
    """Factors of the matrix of the constraints.

    Parameters
    ----------
    rows : (m, n) sparse
        Basis functions, zero for control points that may not move.
    norms : (m,) float64
        Lengths of the rows; 0 if no control point that may move reaches the point.
    cholesky : tuple or None
        Factor of ``B B^T`` with unit rows, if it is well enough conditioned.
    singular : tuple of (m, r) and (r,) float64, or None
        Otherwise the left singular vectors and singular values of the unit rows, rank r.
    condition : float
        Condition of ``B B^T`` with unit rows, or of its part of rank r if rows are dependent.
    """

    rows: csr_array
    norms: Floats
    cholesky: tuple[Floats, bool] | None
    singular: tuple[Floats, Floats] | None
    condition: float

    def multipliers(self, wanted: Floats) -> Floats:
        """Multipliers ``M`` (m, 3) of the moves ``B^T M`` for wanted displacements (m, 3).

        Least squares for dependent rows.
        """
        reachable = wanted - self.unreachable(wanted)
        found = self._solve(reachable)
        # The factors are of the squared matrix; refinement with the matrix itself restores the
        # digits that squaring loses.
        for _ in range(1 if self.condition < _REFINED_ONCE else 2):
            left_over = reachable - self.rows @ (self.rows.T @ found)
            found = found + self._solve(left_over)
        return found

    def moves(self, wanted: Floats, multipliers: Floats) -> Floats:
        """Moves ``B^T M`` (n, 3) of the control points for the multipliers (m, 3) of displacements.

        Multipliers of nearly dependent constraints are large and cancel each other in the sums;
        one more solution for the remainder corrects the rounding errors.
        """
        moved = self.rows.T @ multipliers
        left_over = wanted - self.unreachable(wanted) - self.rows @ moved
        return np.asarray(moved + self.rows.T @ self._solve(left_over))

    def unreachable(self, wanted: Floats) -> Floats:
        """Part of displacements (m, 3) that no move of the control points gives."""
        if self._range is None:
            return np.zeros_like(wanted)
        return np.asarray(wanted - self._range @ (self._range.T @ wanted))

    @cached_property
    def dependent(self) -> Bools:
        """(m,) True for constraints that depend on others."""
        if self._range is None:
            return np.zeros(len(self.norms), dtype=bool)
        return np.asarray(np.einsum("mr,mr->m", self._range, self._range) < 1 - 1e-9)

    @cached_property
    def _range(self) -> Floats | None:
        """Orthonormal basis (m, r) of the displacements that moves can give; None for all."""
        if self.singular is None:
            return None
        left, _ = self.singular
        if left.shape[0] == left.shape[1]:
            return None
        return np.asarray(np.linalg.qr(self._lengths[:, None] * left)[0])

    @cached_property
    def _lengths(self) -> Floats:
        return np.where(self.norms > 0, self.norms, 1.0)

    def _solve(self, wanted: Floats) -> Floats:
        scaled = wanted / self._lengths[:, None]
        if self.singular is not None:
            left, values = self.singular
            found = left @ ((left.T @ scaled) / values[:, None] ** 2)
        else:
            found = cho_solve(self.cholesky, scaled, check_finite=False)
        return np.asarray(found / self._lengths[:, None])


def free_rows(rows: csr_array, free: Bools) -> csr_array:
    """Rows (m, n) of constraints with zeros for control points that are not free (n,)."""
    if free.all():
        return rows
    values = np.where(free[rows.indices], rows.data, 0.0)
    return csr_array((values, rows.indices, rows.indptr), shape=rows.shape)


def factor(rows: csr_array) -> Factored:
    """Factor the rows (m, n) of the constraints by Cholesky, or SVD if they may be dependent."""
    owner = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    norms = np.sqrt(np.bincount(owner, rows.data**2, minlength=rows.shape[0]))
    norms[norms < 1 / _LEVERAGE] = 0.0
    if rows.shape[0] == 1 and norms[0] > 0:
        # One point: delta = R / sum R^2 (T - D(S)), explicitly (Hu 2001, Eq. 7).
        return Factored(rows, norms, (np.ones((1, 1)), False), None, 1.0)
    if np.all(norms > 0) and rows.shape[0] ** 2 <= _MAX_DENSE:
        products = (rows @ rows.T).toarray() / (norms[:, None] * norms)
        try:
            cholesky = cho_factor(products, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            cholesky = None
        if cholesky is not None:
            share, _ = dpocon(cholesky[0], np.abs(products).sum(axis=0).max(), uplo="L")
            if share * _CHOLESKY_CONDITION > 1:
                return Factored(rows, norms, cholesky, None, float(1 / share))
    left, values = _decompose(rows, norms)
    condition = float((values[0] / values[-1]) ** 2) if len(values) else 1.0
    return Factored(rows, norms, None, (left, values), condition)


def _decompose(rows: csr_array, norms: Floats) -> tuple[Floats, Floats]:
    """Left singular vectors and singular values of the unit rows, without negligible ones."""
    touched, place = np.unique(rows.indices, return_inverse=True)
    if rows.shape[0] * len(touched) > _MAX_DENSE:
        raise TooManyConstraints(
            f"{rows.shape[0]} constraints on {len(touched)} control points depend on each other, "
            "and are too many for a decision on rank"
        )
    owner = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    dense = np.zeros((rows.shape[0], len(touched)))
    live = norms[owner] > 0
    dense[owner[live], place[live]] = rows.data[live] / norms[owner[live]]
    left, values, _ = np.linalg.svd(dense, full_matrices=False)
    kept = values > values.max(initial=0.0) / _LEVERAGE
    return left[:, kept], values[kept]
