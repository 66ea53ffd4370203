"""Segments in the plane."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats


def crossing_points(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """(n, 2) points where segments from a to b and from c to d (n, 2) cross within both.

    NaN for none; touching ends do not cross.
    """
    first, last = _turn(c, d, a), _turn(c, d, b)
    crosses = (first * last < 0) & (_turn(a, b, c) * _turn(a, b, d) < 0)
    share = np.where(crosses, first, np.nan) / np.where(crosses, first - last, 1.0)
    return a + share[:, None] * (b - a)


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """(n,) twice the signed area of triangles."""
    ahead, other = b - a, c - a
    return np.asarray(ahead[:, 0] * other[:, 1] - ahead[:, 1] * other[:, 0])
