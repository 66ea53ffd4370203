"""Displacements of beams and plates by formula, their inverses, and meshes to carry them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cantilever:
    """A beam along x, clamped at x = 0, with a force at its tip (Timoshenko).

    ``w = -f (3 l x^2 - x^3) / (2 l^3) - s x``, and sections turn by the slope of bending alone:
    ``u = (-z w_b'(x), 0, w(x))``.
    """

    length: float
    tip: float
    shear: float = 0.01

    def _bending(self, x):
        return -self.tip * (3 * self.length * x**2 - x**3) / (2 * self.length**3)

    def _turn(self, x):
        return -self.tip * (6 * self.length * x - 3 * x**2) / (2 * self.length**3)

    def image(self, points):
        x, y, z = points.T
        deflection = self._bending(x) - self.shear * x
        return np.stack([x - z * self._turn(x), y, z + deflection], axis=1)

    def source(self, images):
        x, z = images[:, 0], images[:, 2]
        for _ in range(60):
            height = images[:, 2] - self._bending(x) + self.shear * x
            x, z = images[:, 0] + height * self._turn(x), height
        return np.stack([x, images[:, 1], z], axis=1)


@dataclass(frozen=True)
class Twist:
    """A plate along x whose sections turn about the x-axis, by an angle in proportion to x."""

    length: float
    angle: float

    def _turned(self, points, sign):
        x, y, z = points.T
        turn = sign * self.angle * x / self.length
        cos, sin = np.cos(turn), np.sin(turn)
        return np.stack([x, y * cos - z * sin, y * sin + z * cos], axis=1)

    def image(self, points):
        return self._turned(points, 1)

    def source(self, images):
        return self._turned(images, -1)


@dataclass(frozen=True)
class EndMoment:
    """A beam along x, clamped at x = 0, bent by a moment into an arc of its own length."""

    radius: float

    def image(self, points):
        x, y, z = points.T
        turn, reach = x / self.radius, self.radius - z
        return np.stack([reach * np.sin(turn), y, self.radius - reach * np.cos(turn)], axis=1)

    def source(self, images):
        x, y, z = images.T
        turn = np.arctan2(x, self.radius - z)
        return np.stack([turn * self.radius, y, self.radius - np.hypot(x, self.radius - z)], axis=1)


def block(low, high, counts):
    """Nodes (n, 3) and bricks (c, 8) of a box, and the quadrilaterals of its surface."""
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(nodes)).reshape(counts)
    ends = [slice(None, -1), slice(1, None)]
    bricks = np.stack(
        [
            number[ends[i], ends[j], ends[k]].ravel()
            for k in (0, 1)
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        ],
        axis=1,
    )
    sides = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 7, 3], [1, 2, 6, 5]]
    quads = np.concatenate([bricks[:, side] for side in sides])
    _, first, uses = np.unique(
        np.sort(quads, axis=1), axis=0, return_index=True, return_counts=True
    )
    return nodes, bricks, quads[np.sort(first[uses == 1])]


def distance_to_box(points, low, high):
    """(n,) distance of points from the surface of a box."""
    outside = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1)
    inside = np.minimum(points - low, high - points).min(axis=1)
    return np.where(inside >= 0, inside, outside)
