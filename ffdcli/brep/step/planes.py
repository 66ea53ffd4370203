"""Planes and straight lines as OpenCascade would hand them on, and curves in their parameters.

OpenCascade divides directions by their lengths and turns the first axis of a plane square to its
normal. The same sums are made here, in the same order, so that files of either writer hold the
same planes and lines, apart from rounding in the last place on some machines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Planes


@dataclass(frozen=True)
class PlaneFrames:
    """Planes (m,) with their axes as files state them, and the row of each surface.

    Parameters
    ----------
    row : (S,) int64
        -1 for surfaces that are no planes.
    origin, normal, x_axis, y_axis : (m, 3) float64
        The second axis, which files leave out, is that of their readers.
    """

    row: Ints
    origin: Floats
    normal: Floats
    x_axis: Floats
    y_axis: Floats

    def parameters(self, surface: Ints, points: Floats) -> Floats:
        """Parameters (n, 2) or (n, k, 2) in planes of points (n, 3) or (n, k, 3)."""
        row = self.row[surface]
        # One point, or several, for each surface.
        several = (slice(None), None) if points.ndim == 3 else slice(None)
        origin, normal = self.origin[row][several], self.normal[row][several]
        # OpenCascade projects points along the normal first.
        height = _dot(origin - points, normal) / _dot(normal, normal)
        arm = points + height[..., None] * normal - origin
        axes = self.x_axis[row][several], self.y_axis[row][several]
        return np.stack([_dot(arm, axis) for axis in axes], axis=-1)

    def directions(self, surface: Ints, vectors: Floats) -> Floats:
        """Unit directions (n, 2) of unit vectors (n, 3) in the planes of surfaces (n,)."""
        row = self.row[surface]
        normal = self.normal[row]
        height = _dot(vectors, normal) / _dot(normal, normal)
        flat = units(vectors - height[:, None] * normal)
        axes = self.x_axis[row], self.y_axis[row]
        return units(np.stack([_dot(flat, axis) for axis in axes], axis=-1))


def frames_of(planes: Planes, count: int, origin: Floats) -> PlaneFrames:
    """The frames of planes among so many surfaces, with origins as files state them."""
    row = np.full(count, -1)
    row[planes.surfaces] = np.arange(len(planes.surfaces))
    normal = units(np.cross(planes.x_axis, planes.y_axis))
    x_axis = units(_cross(normal, _cross(units(planes.x_axis), normal)))
    return PlaneFrames(row, origin, normal, x_axis, units(_cross(normal, x_axis)))


def units(vectors: Floats) -> Floats:
    """Vectors (n, k) divided by their lengths."""
    return vectors / lengths(vectors)


def lengths(vectors: Floats) -> Floats:
    """Lengths (n, 1) of vectors (n, k)."""
    squares = vectors[:, 0] * vectors[:, 0]
    for column in vectors.T[1:]:
        squares = squares + column * column
    return np.asarray(np.sqrt(squares)[:, None])


def _cross(a: Floats, b: Floats) -> Floats:
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _dot(a: Floats, b: Floats) -> Floats:
    """Products (...) of vectors (..., 3), summed in OpenCascade's order."""
    products = a * b
    return np.asarray(products[..., 0] + products[..., 1] + products[..., 2])
