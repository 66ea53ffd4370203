"""Knot vectors of one axis: construction, Greville abscissae, breaks and their continuity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class KnotPlanes:
    """The parameter values along one axis at which a volume changes its polynomial.

    Parameters
    ----------
    values : (n,) or, for many boxes, (m, n) float64
        Increasing, strictly inside the box. NaN stands for no plane.
    continuity : int64, as values
        The volume is C^continuity across the plane; at least 0, since multiplicity <= degree.
    """

    values: Floats
    continuity: Ints


def make_knots(
    degree: int, count: int, low: float, high: float, *, interior: Floats | None, clamped: bool
) -> Floats:
    """Knot vector of ``count`` control points over the interval [low, high].

    Parameters
    ----------
    interior : (count - degree - 1,) float64 or None
        Interior knots as fractions of the interval; None spaces them evenly.
    clamped : bool
        True repeats the end knots ``degree + 1`` times; False continues beyond the box with the
        length of the last interval at each end (Feng et al. 2002, Fig. 2c).

    Returns
    -------
    (count + degree + 1,) float64
    """
    if interior is None:
        fractions = np.arange(1, count - degree) / (count - degree)
    else:
        fractions = np.asarray(interior, dtype=np.float64)
    # A fraction of 1 must give `high` to the last bit, so knots are computed from the nearer end.
    inner = np.where(
        fractions <= 0.5, low + fractions * (high - low), high - (1 - fractions) * (high - low)
    )
    inside = np.concatenate([[low], inner, [high]])
    if clamped:
        return np.concatenate([np.repeat(low, degree), inside, np.repeat(high, degree)])
    first, last = inside[1] - inside[0], inside[-1] - inside[-2]
    before = low - first * np.arange(degree, 0, -1)
    after = high + last * np.arange(1, degree + 1)
    return np.concatenate([before, inside, after])


def greville(knots: Floats, degree: int) -> Floats:
    """Greville abscissae (n,): control points there make the volume the identity.

    Feng et al. 2002, section 3.1. Means are taken about the middle knot, so that equal knots give
    that knot exactly.
    """
    count = len(knots) - degree - 1
    windows = np.lib.stride_tricks.sliding_window_view(knots, degree)[1 : count + 1]
    middle = windows[:, degree // 2]
    return np.asarray(middle + (windows - middle[:, None]).mean(axis=1))


def knot_planes(knots: Floats, degree: int) -> KnotPlanes:
    """Interior breaks of a knot vector with their continuity ``degree - multiplicity``."""
    inside = knots[degree + 1 : len(knots) - degree - 1]
    values, multiplicity = np.unique(inside, return_counts=True)
    return KnotPlanes(values, degree - multiplicity)


def find_spans(knots: Floats, degree: int, values: Floats) -> Ints:
    """Index m of the non-empty span [t_m, t_{m+1}) that holds each value (...).

    The last span is closed; values outside the box get the first or last span.
    """
    count = len(knots) - degree - 1
    low, high = knots[degree], knots[count]
    first = int(np.searchsorted(knots, low, side="right")) - 1
    last = int(np.searchsorted(knots, high, side="left")) - 1
    return np.clip(np.searchsorted(knots, values, side="right") - 1, first, last)


def blossom_weights(knots: Floats, degree: int, spans: Ints, arguments: Floats) -> Floats:
    """Weights of the polar form of polynomial pieces, for many argument tuples.

    The blossom of the piece on span ``m`` at ``(x_1, ..., x_k)`` is
    ``sum_j weights[j] P[m - k + j]``. With equal arguments the weights are the basis functions,
    extrapolated where the arguments lie outside the span (the generalised de Boor-Cox algorithm of
    Feng et al. 2002, section 3.4.2).

    Parameters
    ----------
    spans : (...) int64
    arguments : (..., degree) float64

    Returns
    -------
    (..., degree + 1) float64
    """
    shape = np.broadcast_shapes(spans.shape, arguments.shape[:-1])
    weights = np.zeros((*shape, degree + 1))
    weights[..., 0] = 1.0
    for r in range(1, degree + 1):
        x = arguments[..., r - 1]
        carried = np.zeros(shape)
        for j in range(r):
            upper = knots[spans + j + 1]
            lower = knots[spans + 1 - r + j]
            share = weights[..., j] / (upper - lower)
            weights[..., j] = carried + (upper - x) * share
            carried = (x - lower) * share
        weights[..., r] = carried
    return weights


def value_weights(knots: Floats, degree: int, spans: Ints, places: Floats) -> Floats:
    """Matrices (m, 1, degree + 1) from local control points to the value at a place (m,)."""
    return blossom_weights(knots, degree, spans, np.repeat(places[:, None], degree, 1))[:, None]


def restriction_weights(
    knots: Floats, degree: int, spans: Ints, low: Floats, high: Floats
) -> Floats:
    """Matrices from local control points to Bézier points over [low, high].

    Parameters
    ----------
    spans, low, high : (m,)

    Returns
    -------
    (m, degree + 1, degree + 1) float64
        Bézier point ``i`` is ``sum_j out[:, i, j] P[span - degree + j]``, the blossom at ``low``
        repeated ``degree - i`` times and ``high`` repeated ``i`` times.
    """
    steps = np.arange(degree)
    take_high = steps[None, :] >= degree - np.arange(degree + 1)[:, None]
    arguments = np.where(take_high, high[:, None, None], low[:, None, None])
    return blossom_weights(knots, degree, spans[:, None], arguments)
