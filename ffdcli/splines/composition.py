"""Bernstein forms: composition with a plane, and diagonals of boxes.

All results are sums of products with weights in [0, 1], so control points are accurate to a few
units in the last place of their hull. Collocation (Feng et al. 2002, Eq. 3 and 4) gives the same
points and is the cross-check in the tests; it loses digits as the degree grows.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.polynomials import binomials

# Cells evaluated at once: bounds the memory.
_CHUNK_CELLS = 1024


def in_parts(chosen: Ints, cells: int) -> list[Ints]:
    """Split items (n,) with ``cells`` cells each into parts that fit the processor's cache."""
    parts = min(len(chosen), -(-len(chosen) * cells // _CHUNK_CELLS))
    return np.array_split(chosen, max(1, parts))


def compose_plane(points: Floats, share: Floats) -> Floats:
    """Substitute a sloping plane for the first variable of trivariate Bernstein forms.

    ``V(r, s, t)`` of degree ``(ka, kb, kc)`` on the unit cube becomes ``V(r(s, t), s, t)`` of
    degree ``(kb + ka, kc + ka)``, where ``r`` is bilinear without twist: each Bernstein polynomial
    of ``r`` becomes one of ``s`` and ``t`` and multiplies its coefficients (after DeRose 1988,
    cited in Feng et al. 2002).

    Parameters
    ----------
    points : (m, ka + 1, kb + 1, kc + 1, d) float64
    share : (m, 2, 2) float64
        ``r`` at the corners, ``share[:, i, j]`` at ``s = i, t = j``; within [0, 1].

    Returns
    -------
    (m, kb + ka + 1, kc + ka + 1, d) float64
    """
    ka, kb, kc = (n - 1 for n in points.shape[1:4])
    factors = _plane_factors(share, ka)
    scale = binomials(kb)[:, None] * binomials(kc)[None, :]
    scaled = np.ascontiguousarray(np.moveaxis(points, 0, -1)) * scale[:, :, None, None]
    total = binomials(kb + ka)[:, None] * binomials(kc + ka)[None, :]
    out = np.zeros((*total.shape, *scaled.shape[3:]))
    for i in range(ka + 1):
        for j in range(ka + 1):
            part = out[i : i + kb + 1, j : j + kc + 1]
            part += np.einsum("am,abcdm->bcdm", factors[i, j], scaled)
    out /= total[:, :, None, None]
    return np.moveaxis(out, -1, 0)


def _plane_factors(share: Floats, degree: int) -> Floats:
    """Bernstein polynomials of the height r as scaled Bernstein forms in s and t.

    By de Casteljau's algorithm in ``r``, with polynomials in place of numbers.

    Returns
    -------
    (degree + 1, degree + 1, degree + 1, m) float64
        Indexed by the powers along s and t, then by the polynomial in r.
    """
    order, m = degree + 1, len(share)
    corners = np.ascontiguousarray(np.moveaxis(share, 0, -1))
    current = np.zeros((order, 1, 1, order, m))
    current[np.arange(order), 0, 0, np.arange(order)] = 1.0
    for _ in range(degree):
        n, p, q = current.shape[:3]
        lower, upper = current[:-1], current[1:]
        raised = np.zeros((n - 1, p + 1, q + 1, order, m))
        for i in range(2):
            for j in range(2):
                step = (1 - corners[i, j]) * lower
                step += corners[i, j] * upper
                raised[:, i : i + p, j : j + q] += step
        current = raised
    return current[0]


def _zeros(m: int, *shape: int) -> Floats:
    """(m, ...) zeros with the m items last in memory, so that sums run over all items."""
    return np.moveaxis(np.zeros((*shape, m)), -1, 0)


def merge_variables(points: Floats, first: int, second: int) -> Floats:
    """Set two variables of Bernstein forms equal; their degrees add up.

    Parameters
    ----------
    points : (m, ..., d) float64
        Axis ``first`` has degree p, axis ``second`` (behind it) degree q.

    Returns
    -------
    (m, ..., d) float64
        Without axis ``second``; axis ``first`` has degree p + q.
    """
    moved = np.moveaxis(points, (first, second), (1, 2))
    p, q = moved.shape[1] - 1, moved.shape[2] - 1
    out = _zeros(len(points), p + q + 1, *moved.shape[3:])
    weight = binomials(p)[:, None] * binomials(q)[None, :]
    for i in range(p + 1):
        for j in range(q + 1):
            out[:, i + j] += weight[i, j] * moved[:, i, j]
    out /= binomials(p + q).reshape(-1, *([1] * (out.ndim - 2)))
    return np.moveaxis(out, 1, first)
