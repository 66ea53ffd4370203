"""Single B-splines, each on knots of its own: values, Bézier points, Chebyshev coefficients."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.knots import blossom_weights


def bspline_values(knots: Floats, at: Floats) -> Floats:
    """B-splines on knots (q, k + 2) at places (q, p)."""
    degree = knots.shape[1] - 2
    x, t = at[:, :, None], knots[:, None, :]
    # Half-open pieces: from degree 1 on, the side that a knot belongs to makes no difference.
    parts = ((x >= t[..., :-1]) & (x < t[..., 1:])).astype(np.float64)
    for k in range(1, degree + 1):
        left, right = t[..., : -k - 1], t[..., k + 1 :]
        rise = (x - left) / (t[..., k:-1] - left)
        fall = (right - x) / (right - t[..., 1:-k])
        parts = rise * parts[..., :-1] + fall * parts[..., 1:]
    return np.asarray(parts[..., 0])


def chebyshev_forms(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Chebyshev coefficients (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each.
    """
    degree = knots.shape[1] - 2
    nodes = np.polynomial.chebyshev.chebpts1(degree + 1)
    at = low[:, None] + (high - low)[:, None] * (1 + nodes) / 2
    values = bspline_values(knots.astype(np.float64), at)
    # At these points the polynomials are orthogonal.
    transform = np.polynomial.chebyshev.chebvander(nodes, degree) * 2 / (degree + 1)
    transform[:, 0] /= 2
    return values @ transform


def bezier_forms(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Bézier points (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each. Each function belongs to a B-spline basis whose other
    knots do not matter; its Bézier points are blossoms.
    """
    rows, degree = len(knots), knots.shape[1] - 2
    steps = np.arange(1, degree + 1)
    padded = np.column_stack([knots[:, :1] - steps[::-1], knots, knots[:, -1:] + steps]).astype(
        np.float64
    )
    span = (knots <= low[:, None]).sum(axis=1) - 1
    spans = np.arange(rows) * padded.shape[1] + degree + span
    take_high = np.arange(degree)[None, :] >= degree - np.arange(degree + 1)[:, None]
    arguments = np.where(take_high, high[:, None, None], low[:, None, None]).astype(np.float64)
    weights = blossom_weights(padded.ravel(), degree, spans[:, None], arguments)
    out: Floats = np.take_along_axis(weights, (degree - span)[:, None, None], axis=2)[:, :, 0]
    return out
