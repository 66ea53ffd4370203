"""Bernstein forms: composition with a plane, diagonals of boxes, and joining pieces to B-splines.

Everything here is sums of products with weights in [0, 1], so control points come out within a few
units in the last place of their hull. Collocation (Feng 2002, Eq. 3 and 4) gives the same points
and serves the tests as a cross-check; it loses digits as the degree grows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffdcli.volume.polynomials import binomials

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cells evaluated at once.
_CHUNK_CELLS = 1024


def in_parts(chosen: Ints, cells: int) -> list[Ints]:
    """Items (n,) that have so many cells each, in parts that stay in the processor's cache."""
    parts = min(len(chosen), -(-len(chosen) * cells // _CHUNK_CELLS))
    return np.array_split(chosen, max(1, parts))


def compose_plane(points: Floats, share: Floats) -> Floats:
    """Substitute a sloping plane for the first variable of trivariate Bernstein forms.

    ``V(r, s, t)`` of degree ``(ka, kb, kc)`` on the unit cube becomes ``V(r(s, t), s, t)`` of
    degree ``(kb + ka, kc + ka)``, where ``r`` is bilinear without twist. It is de Casteljau's
    algorithm in ``r`` with polynomials in place of numbers (after DeRose 1988, named in Feng
    2002): each step multiplies scaled Bernstein forms by ``1 - r`` and ``r``.

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
    scale = binomials(kb)[:, None] * binomials(kc)[None, :]
    current = points * scale[None, None, :, :, None]
    for _ in range(ka):
        m, n, p, q, d = current.shape
        lower, upper = current[:, :-1], current[:, 1:]
        raised = _zeros(m, n - 1, p + 1, q + 1, d)
        for i in range(2):
            for j in range(2):
                r = np.ascontiguousarray(share[:, i, j])[:, None, None, None, None]
                step = (1 - r) * lower
                step += r * upper
                raised[:, :, i : i + p, j : j + q] += step
        current = raised
    total = binomials(kb + ka)[:, None] * binomials(kc + ka)[None, :]
    return np.asarray(current[:, 0] / total[None, :, :, None])


def _zeros(m: int, *shape: int) -> Floats:
    """(m, ...) zeros that lie in memory with the m items last: sums run over all of them."""
    return np.moveaxis(np.zeros((*shape, m)), -1, 0)


def merge_variables(points: Floats, first: int, second: int) -> Floats:
    """Set two variables of Bernstein forms equal: degrees add, the result stands at ``first``.

    Parameters
    ----------
    points : (m, ..., d) float64
        Axis ``first`` has degree p, axis ``second`` (behind it) degree q.

    Returns
    -------
    float64 array without axis ``second``; axis ``first`` has degree p + q.
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


def join_pieces(pieces: Floats, breaks: Floats, mults: Ints) -> Floats:
    """Control points of the B-spline that consecutive Bézier pieces make up.

    Each control point is the blossom of one piece at ``degree`` consecutive knots; the longest
    piece between those knots is taken, which keeps the continuation short.

    Parameters
    ----------
    pieces : (m, J, degree + 1, ...) float64
    breaks : (m, J + 1) float64
    mults : (J - 1,) int64
        Multiplicities of the interior breaks; the pieces join with continuity
        ``degree - multiplicity``.

    Returns
    -------
    (m, degree + 1 + sum(mults), ...) float64
    """
    m, count, degree = pieces.shape[0], pieces.shape[1], pieces.shape[2] - 1
    if count == 1:
        return pieces[:, 0]
    index = np.repeat(np.arange(count + 1), np.concatenate([[degree + 1], mults, [degree + 1]]))
    windows = np.lib.stride_tricks.sliding_window_view(index, degree)[1:-1]
    number = np.arange(count)
    # A point at one break alone (an end, or multiplicity ``degree``) lies on the pieces beside it.
    alone = windows[:, :1] == windows[:, -1:]
    among = (number >= windows[:, :1] - alone) & (number < windows[:, -1:] + alone)
    lengths = np.diff(breaks, axis=1)
    chosen = np.argmax(np.where(among[None], lengths[:, None, :], -1.0), axis=2)
    rows = np.arange(m)[:, None]
    points = pieces[rows, chosen]
    low, length = breaks[rows, chosen], lengths[rows, chosen]
    arguments = breaks[:, windows]
    extra = (1,) * (pieces.ndim - 2)
    for r in range(degree):
        share = ((arguments[:, :, r] - low) / length).reshape(m, -1, *extra)
        upper = share * points[:, :, 1:]
        points = (1 - share) * points[:, :, :-1]
        points += upper
    return points[:, :, 0]
