"""Joints of Bézier pieces to B-splines: control points as sums of those of one piece.

The sums depend on the breaks alone: they are planned once (:func:`plan_joint`) and applied to any
pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class Joint:
    """The control points of m B-splines as sums of those of their Bézier pieces.

    Parameters
    ----------
    piece : (m, n) int64
        The piece that each control point comes from.
    weights : (m, n, degree + 1) float64
        Weights of that piece's control points; they add up to 1.
    """

    piece: Ints
    weights: Floats

    def take(self, chosen: Ints) -> Joint:
        """The joints of the chosen B-splines."""
        return Joint(self.piece[chosen], self.weights[chosen])

    def apply(self, pieces: Floats, chosen: Ints) -> Floats:
        """Control points (c, n, x) of chosen B-splines (c,) from pieces (c, J, degree + 1, x)."""
        if pieces.shape[1] == 1:
            return pieces[:, 0]
        points = pieces[np.arange(len(pieces))[:, None], self.piece[chosen]]
        return np.asarray(np.einsum("mnp,mnpx->mnx", self.weights[chosen], points))


def plan_joint(breaks: Floats, mults: Ints, degree: int) -> Joint:
    """Plan the joints of consecutive Bézier pieces.

    Each control point is the blossom of one piece at ``degree`` consecutive knots. The longest
    piece between those knots is chosen, which keeps the extrapolation short.

    Parameters
    ----------
    breaks : (m, J + 1) float64
    mults : (J - 1,) int64
        Multiplicities of the interior breaks; the pieces join with continuity
        ``degree - multiplicity``.
    degree : int
    """
    m, count = breaks.shape[0], breaks.shape[1] - 1
    if count == 1:
        order = degree + 1
        piece = np.broadcast_to(np.int64(0), (m, order))
        return Joint(piece, np.broadcast_to(np.eye(order), (m, order, order)))
    index = np.repeat(np.arange(count + 1), np.concatenate([[degree + 1], mults, [degree + 1]]))
    windows = np.lib.stride_tricks.sliding_window_view(index, degree)[1:-1]
    number = np.arange(count)
    # A point at a single break (an end, or multiplicity ``degree``) lies on the adjacent pieces.
    alone = windows[:, :1] == windows[:, -1:]
    among = (number >= windows[:, :1] - alone) & (number < windows[:, -1:] + alone)
    lengths = np.diff(breaks, axis=1)
    piece = np.argmax(np.where(among[None], lengths[:, None, :], -1.0), axis=2)
    rows = np.arange(m)[:, None]
    low, length = breaks[rows, piece], lengths[rows, piece]
    # The blossom's weights are the coefficients of prod (1 - s_r + s_r z), by powers of z.
    weights = np.zeros((degree + 1, *piece.shape))
    weights[0] = 1.0
    for r in range(degree):
        share = (breaks[:, windows[:, r]] - low) / length
        upper = share * weights[: r + 1]
        weights[: r + 1] *= 1 - share
        weights[1 : r + 2] += upper
    return Joint(piece, np.ascontiguousarray(np.moveaxis(weights, 0, -1)))
