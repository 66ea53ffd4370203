"""Sample points spread over triangles, with a density per octree level."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.fitting.levels import codes_of

# What triangles may reach out of the cube by rounding.
_ROUNDING = 1e-9
# Steps of an additive recurrence that fills a square evenly (its base is the plastic number).
_STEPS = (0.7548776662466927, 0.5698402909980532)


@dataclass(frozen=True)
class Surface:
    """Triangles in the unit cube.

    Parameters
    ----------
    triangles : (T, 3, 3) float64
    """

    triangles: Floats

    @classmethod
    def clipped(cls, triangles: Floats) -> Surface:
        """The parts of triangles (T, 3, 3) that lie in the unit cube."""
        for axis in range(3):
            triangles = _above(triangles, axis, 1.0, -_ROUNDING)
            triangles = _above(triangles, axis, -1.0, -1.0 - _ROUNDING)
        return cls(triangles.clip(0.0, 1.0))

    @cached_property
    def _weights(self) -> Floats:
        """(T + 1,) cumulative areas; an area is the sum of its projections on the axis planes."""
        sides = self.triangles[:, 1:] - self.triangles[:, :1]
        area = np.abs(np.cross(sides[:, 0], sides[:, 1])).sum(axis=1) / 2
        return np.concatenate([[0.0], np.cumsum(area)])

    def points(self, level: int, density: float, seed: int, fewest: int = 0) -> Floats:
        """(n, 3) points, determined by the seed; at least the fewest.

        A piece of surface as large as a face of a cell of the level gets ``density`` points.
        """
        random = np.random.default_rng(seed)
        count = max(int(np.ceil(density * self._weights[-1] * 4.0**level)), fewest)
        at = (np.arange(count) + random.random(count)) / count * self._weights[-1]
        last = len(self.triangles) - 1
        triangle = (np.searchsorted(self._weights, at, side="right") - 1).clip(0, last)
        start = random.random(2)
        share = (start + np.multiply.outer(np.arange(count), _STEPS)) % 1
        beyond = share.sum(axis=1) > 1
        share[beyond] = 1 - share[beyond]
        return self._at(triangle, share)

    def meeting(self, codes: Ints, level: int) -> Surface:
        """The parts of the surface in or near cells of a level, given by Morton codes.

        Triangles near the cells are quartered down to the size of the cells.
        """
        triangles = self.triangles
        for at in range(level + 1):
            above = np.unique(codes >> 3 * (level - at))
            large = np.ptp(triangles, axis=1).max(axis=1) > 0.5**at
            while large.any():
                quarters = _quartered(triangles[large])
                triangles = np.concatenate([triangles[~large], quarters])
                large = np.ptp(triangles, axis=1).max(axis=1) > 0.5**at
            # A triangle is no larger than a cell, so the corners of its box lie in all cells it
            # meets.
            low, high = triangles.min(axis=1), triangles.max(axis=1)
            near = np.zeros(len(triangles), dtype=bool)
            for corner in np.indices((2, 2, 2)).reshape(3, -1).T:
                near |= np.isin(codes_of(np.where(corner, high, low), at), above)
            triangles = triangles[near]
        return Surface(triangles)

    def outlines(self) -> Floats:
        """(n, 3) corners of the triangles, and three points inside every side."""
        corner = self.triangles
        along = np.array([0.0, 0.21, 0.5, 0.79])[:, None]
        sides = [
            (1 - along) * corner[:, i, None] + along * corner[:, (i + 1) % 3, None]
            for i in range(3)
        ]
        return np.unique(np.concatenate(sides).reshape(-1, 3), axis=0)

    def _at(self, triangle: Ints, share: Floats) -> Floats:
        corner = self.triangles[triangle]
        sides = corner[:, 1:] - corner[:, :1]
        return np.asarray(corner[:, 0] + (share[:, :, None] * sides).sum(axis=1))


def _above(triangles: Floats, axis: int, sign: float, value: float) -> Floats:
    """The parts of triangles (n, 3, 3) where ``sign`` times a coordinate is at least a value."""
    height = sign * triangles[:, :, axis] - value
    above = height >= 0
    count = above.sum(axis=1)
    parts = [triangles[count == 3]]
    for number in (1, 2):
        # The corner that is alone on its side of the plane comes first.
        chosen = count == number
        first = np.argmax(above[chosen] == (number == 1), axis=1)
        turn = (first[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(triangles[chosen], turn[:, :, None], axis=1)
        off = np.take_along_axis(height[chosen], turn, axis=1)
        share = (off[:, :1] / (off[:, :1] - off[:, 1:]))[:, :, None]
        a, (b, c) = corner[:, 0], np.moveaxis(corner[:, 1:], 1, 0)
        p, q = np.moveaxis(corner[:, :1] + share * (corner[:, 1:] - corner[:, :1]), 1, 0)
        kept = [(a, p, q)] if number == 1 else [(p, b, c), (p, c, q)]
        parts += [np.stack(each, axis=1) for each in kept]
    return np.concatenate(parts)


def _quartered(triangles: Floats) -> Floats:
    """(4 n, 3, 3) quarters of triangles (n, 3, 3), divided at the midpoints of their sides."""
    a, b, c = (triangles[:, i] for i in range(3))
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(each, axis=1) for each in corners])
