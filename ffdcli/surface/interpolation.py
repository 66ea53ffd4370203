"""Control points of tensor-product Bézier patches by interpolation (Feng 2002, Eq. 3 and 4).

The matrix of one degree is constant: it takes control points to the points at uniform parameters.
It and its inverse are made once, in exact arithmetic, and kept.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from math import comb

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.splines.polynomials import bernstein

# Number of parameters at which the Lebesgue function is sampled, between two uniform ones.
_FINE = 32


def interpolate(samples: Floats) -> Floats:
    """Control points of patches from their points at uniform parameters.

    One correction by the same matrices brings the patches as close to the samples as solving the
    equations does; control points still lose digits as the degree grows.

    Parameters
    ----------
    samples : (m, ns + 1, nt + 1, c) float64

    Returns
    -------
    (m, ns + 1, nt + 1, c) float64
    """
    found = _along_both(inverse_matrix, samples)
    return found + _along_both(inverse_matrix, samples - _along_both(uniform_matrix, found))


@lru_cache(maxsize=64)
def uniform_matrix(degree: int) -> Floats:
    """(degree + 1, degree + 1) matrix from control points to points at ``i / degree``."""
    return _frozen(_exact(degree))


@lru_cache(maxsize=64)
def inverse_matrix(degree: int) -> Floats:
    """The inverse of :func:`uniform_matrix`, each entry correctly rounded."""
    rows = [[*row, *(Fraction(i == j) for j in range(degree + 1))]
            for i, row in enumerate(_exact(degree))]  # fmt: skip
    # The matrix is totally positive: elimination without exchange of rows meets no zero.
    for i in range(degree + 1):
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for j in range(degree + 1):
            if j != i and rows[j][i]:
                factor = rows[j][i]
                rows[j] = [a - factor * b for a, b in zip(rows[j], rows[i], strict=True)]
    return _frozen([row[degree + 1 :] for row in rows])


@lru_cache(maxsize=64)
def lebesgue(degree: int) -> float:
    """Lebesgue constant: the factor by which errors of samples may grow in between.

    It is sampled, which is within some percent of the maximum.
    """
    places = np.linspace(0.0, 1.0, _FINE * degree + 1)
    return float(np.abs(bernstein(degree, places) @ inverse_matrix(degree)).sum(axis=1).max())


def _along_both(matrix: Callable[[int], Floats], grid: Floats) -> Floats:
    """Multiply by the matrix of each degree, that of the lower degree first (section 3.4.2)."""
    for axis in (1, 2) if grid.shape[1] <= grid.shape[2] else (2, 1):
        front = np.moveaxis(grid, axis, 0)
        product = matrix(len(front) - 1) @ front.reshape(len(front), -1)
        grid = np.moveaxis(product.reshape(front.shape), 0, axis)
    return grid


def _exact(degree: int) -> list[list[Fraction]]:
    places = [Fraction(i, degree) for i in range(degree + 1)]
    return [
        [comb(degree, j) * t**j * (1 - t) ** (degree - j) for j in range(degree + 1)]
        for t in places
    ]


def _frozen(rows: list[list[Fraction]]) -> Floats:
    matrix = np.array(rows, dtype=np.float64)
    matrix.flags.writeable = False
    return matrix
