"""Maps from control nets of tensor products to Bézier points of many boxes, axis by axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class TensorRestriction:
    """Bézier points of many boxes as three small matrices each, applied axis by axis.

    Parameters
    ----------
    first : (m, 3) int64
        Lowest control point index that reaches each box.
    weights : three (k_a + 1, k_a + 1, m) float64
        Rows are Bézier points, or a value and a slope at a point; columns are control points. The
        boxes come last, so that every sum runs over all boxes.
    """

    first: Ints
    weights: tuple[Floats, Floats, Floats]

    @property
    def as_tensor(self) -> TensorRestriction:
        """This map, which is one per axis already."""
        return self

    @property
    def growth(self) -> Floats:
        """(m,) largest sum of the absolute weights of a Bézier point of each box."""
        u, v, w = (np.abs(weights).sum(axis=1).max(axis=0) for weights in self.weights)
        return np.asarray(u * v * w)

    def take(self, part: Ints) -> TensorRestriction:
        """The map to the boxes in ``part``."""
        u, v, w = (weights[..., part] for weights in self.weights)
        return TensorRestriction(self.first[part], (u, v, w))

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Degrees of the volume."""
        u, v, w = (weights.shape[1] - 1 for weights in self.weights)
        return u, v, w

    def matrices(self, part: Ints) -> Floats:
        """Matrices (m, ku + 1, kv + 1, kw + 1, n) of the same map.

        The last axis runs over the ``n`` control points that reach each box, w fastest.
        """
        u, v, w = (weights[..., part] for weights in self.weights)
        uv = u[:, None, :, None] * v[None, :, None, :]
        out = uv[:, :, None, :, :, None] * w[None, None, :, None, None]
        count = int(np.prod(out.shape[3:6]))
        return np.moveaxis(out.reshape(*out.shape[:3], count, len(part)), -1, 0)

    def apply(self, net: Floats, part: slice | Ints = slice(None)) -> Floats:
        """Bézier points (m, ku + 1, kv + 1, kw + 1, c) for a net (nu, nv, nw, c).

        The boxes come last in memory.
        """
        weights = [each[..., part] for each in self.weights]
        points = _gather(net, self.first[part], self.degrees)
        for axis, each in enumerate(weights):
            points = _mix(each, points, axis)
        return np.moveaxis(points, -1, 0)


def _gather(net: Floats, first: Ints, degrees: Sequence[int]) -> Floats:
    """Control points (ku + 1, kv + 1, kw + 1, c, m) from index ``first`` (m, 3) on."""
    u, v, w = (first[:, axis] + np.arange(k + 1)[:, None] for axis, k in enumerate(degrees))
    _, nv, nw, c = net.shape
    index = (u[:, None, None] * nv + v[:, None]) * nw + w
    points = np.empty((*index.shape[:3], c, len(first)))
    for component in range(c):
        np.take(net[..., component].ravel(), index, out=points[:, :, :, component], mode="clip")
    return points


def _mix(weights: Floats, points: Floats, axis: int) -> Floats:
    """Sums of weights (i, j, m) times points (..., j, ..., m) over j, which i replaces."""
    letters = "uvw".replace("uvw"[axis], "j")
    shape = [*points.shape]
    shape[axis] = len(weights)
    mixed = np.empty(shape)
    np.einsum(f"ijm,{letters}cm->{letters.replace('j', 'i')}cm", weights, points, out=mixed)
    return mixed
