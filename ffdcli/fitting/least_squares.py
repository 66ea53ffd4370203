"""Sparse least squares for functions of local support, in any number.

The normal equations are solved by conjugate gradients, preconditioned by the exact inverse of their
diagonal blocks. The near dependences that make the system ill-conditioned are between neighbouring
functions, most of which share a block. A small system is one block, solved directly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array

from ffdcli.arrays import Floats, Ints

# Unknowns of a block; largest system that is a single block.
_BLOCK = 2_500
_ONE_BLOCK = 4_000
# Damping of the coefficients, as a share of the mean diagonal: it determines those that the points
# leave free.
_DAMPING = 1e-5
# Further solves for the residual, which remove the damping where the points determine coefficients.
_AGAIN = 2
_MOST_STEPS = 60
# Relative residual at which the iteration ends.
_ENOUGH = 1e-7

Solve = Callable[[Floats], Floats]


def solve_least_squares(matrix: csr_array, wanted: Floats, order: Ints) -> Floats:
    """Coefficients x (n, c) that minimise ``|matrix x - wanted|``, slightly damped.

    Parameters
    ----------
    matrix : (m, n) sparse
    wanted : (m, c) float64
    order : (n,) int64
        Order of the unknowns in which those that share points are close together.
    """
    if not len(order):
        return np.zeros((0, wanted.shape[1]))
    columns = csc_array(matrix)[:, order]
    normal = csc_array(columns.T @ columns)
    scale = float(normal.diagonal().mean())
    if scale == 0:
        return np.zeros((len(order), wanted.shape[1]))
    normal = csc_array(normal + _DAMPING * scale * eye_array(len(order), format="csc"))
    step = len(order) if len(order) <= _ONE_BLOCK else _BLOCK
    blocks = [slice(start, start + step) for start in range(0, len(order), step)]
    factored = [_factor(csc_array(normal[part, part])) for part in blocks]

    def precondition(residual: Floats) -> Floats:
        parts = [solve(residual[part]) for solve, part in zip(factored, blocks, strict=True)]
        return np.concatenate(parts)

    normal = csr_array(normal)
    found = _conjugate_gradients(normal, columns.T @ wanted, precondition)
    for _ in range(_AGAIN):
        left_over = columns.T @ (wanted - columns @ found)
        found += _conjugate_gradients(normal, left_over, precondition)
    out = np.empty_like(found)
    out[order] = found
    return out


def _factor(block: csc_array) -> Solve:
    from scipy.sparse.linalg import splu

    # Symmetric and positive definite, so pivots on the diagonal suffice.
    factors = splu(
        block, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return lambda right: np.asarray(factors.solve(right))


def _conjugate_gradients(matrix: csr_array, right: Floats, precondition: Solve) -> Floats:
    """Solution (n, c) for all columns of ``right``."""
    from scipy.sparse.linalg import LinearOperator, cg

    near = LinearOperator(matrix.shape, matvec=precondition, dtype=np.float64)
    columns = [
        cg(matrix, column, rtol=_ENOUGH, maxiter=_MOST_STEPS, M=near)[0] for column in right.T
    ]
    return np.stack(columns, axis=1)
