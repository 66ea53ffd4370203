"""Matrices from a control net to many sums of the control points that reach one knot box.

A control point of a surface or curve, a vertex, a derivative: each is a sum of the control points
of the net that reach one knot box. With the weights stored, all sums of a knot box are one product
of matrices, several times as fast as the composition; a row takes ``8 (k + 1)^3`` bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints

# Weights multiplied at once: so few that no linear algebra library uses several threads, which
# might change the order of summation.
_TILE = 65_536


@dataclass(frozen=True)
class LocalSums:
    """Rows of weights, grouped by knot box.

    Parameters
    ----------
    degrees : (int, int, int)
        Degrees of the volume: a row has ``prod(k + 1)`` weights, w fastest.
    first : (g, 3) int64
        Lowest control point index that reaches each of the knot boxes.
    starts : (g + 1,) int64
        First row of each box.
    matrix : (r, prod(k + 1)) float64
    place : (r,) int64
        Row of the matrix that holds each sum.
    """

    degrees: tuple[int, int, int]
    first: Ints
    starts: Ints
    matrix: Floats
    place: Ints

    @property
    def bytes(self) -> int:
        """Memory used."""
        return self.matrix.nbytes + self.place.nbytes

    def apply(self, net: Floats) -> Floats:
        """The sums (r, c) for a net (nu, nv, nw, c)."""
        out = np.empty((len(self.matrix), net.shape[3]))
        ends = self.first + np.array(self.degrees) + 1
        step = max(1, _TILE // self.matrix.shape[1])
        for box, (low, high) in enumerate(zip(self.first.tolist(), ends.tolist(), strict=True)):
            reached = net[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
            local = np.ascontiguousarray(reached).reshape(-1, net.shape[3])
            stop = int(self.starts[box + 1])
            for start in range(int(self.starts[box]), stop, step):
                tile = slice(start, min(start + step, stop))
                np.matmul(self.matrix[tile], local, out=out[tile])
        return out[self.place]


def collect_sums(
    degrees: tuple[int, int, int],
    first: Ints,
    box: Ints,
    rows: Iterable[tuple[Ints, Floats]],
) -> LocalSums:
    """Group rows of weights by knot box.

    Parameters
    ----------
    degrees : (int, int, int)
    first : (m, 3) int64
        Lowest control point index that reaches each of m boxes, which need not be distinct.
    box : (r,) int64
        The box of each sum.
    rows : iterable of (n,) int64, (n, prod(k + 1)) float64
        Numbers of sums and their weights; each sum occurs once.
    """
    distinct, which = np.unique(first, axis=0, return_inverse=True)
    group = which.reshape(-1)[box]
    order = np.argsort(group, kind="stable")
    place = np.empty(len(box), dtype=np.int64)
    place[order] = np.arange(len(box))
    matrix = np.empty((len(box), int(np.prod([k + 1 for k in degrees]))))
    for numbers, weights in rows:
        matrix[place[numbers]] = weights
    starts = np.searchsorted(group[order], np.arange(len(distinct) + 1))
    return LocalSums(degrees, distinct, starts, matrix, place)
