"""Bernstein polynomials and their derivatives at many parameters."""

from __future__ import annotations

from math import comb

import numpy as np

from ffdcli.arrays import Floats


def bernstein_values(degree: int, at: Floats) -> Floats:
    """(..., degree + 1) Bernstein polynomials at parameters (...) on [0, 1]."""
    return np.moveaxis(_rows(degree, at), 0, -1)


def bernstein(degree: int, at: Floats) -> tuple[Floats, Floats]:
    """Bernstein polynomials and their derivatives at parameters (...) on [0, 1].

    Returns
    -------
    values, slopes : (..., degree + 1) float64
    """
    slopes = np.zeros((degree + 1, *at.shape))
    if degree:
        # Each Bernstein polynomial of one degree less enters two neighbouring slopes.
        lower = _rows(degree - 1, at)
        lower *= degree
        slopes[1:] = lower
        slopes[:-1] -= lower
    return bernstein_values(degree, at), np.moveaxis(slopes, 0, -1)


def _rows(degree: int, at: Floats) -> Floats:
    """(degree + 1, ...) Bernstein polynomials: long rows are several times faster."""
    rising, falling = np.empty((2, degree + 1, *at.shape))
    rest = 1 - at
    rising[0] = falling[degree] = 1.0
    for i in range(1, degree + 1):
        np.multiply(rising[i - 1], at, out=rising[i])
        np.multiply(falling[degree - i + 1], rest, out=falling[degree - i])
    for i in range(degree + 1):
        rising[i] *= comb(degree, i)
    rising *= falling
    return np.asarray(rising)
