"""Winding numbers of triangles round points, and nearest points on triangles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffdcli.arrays import Floats

# Pairs of a point and a triangle in one step: limits the memory.
_PAIRS = 50_000


def winding_numbers(points: Floats, corners: Floats) -> Floats:
    """(n,) winding number of triangles (T, 3, 3) round points (n, 3): 1 inside, 0 outside.

    Integers, to rounding, if the triangles are closed and the points not on them. Sum of solid
    angles (van Oosterom and Strackee 1983, eq. 8).
    """
    found = np.zeros(len(points))
    step = max(1, _PAIRS // max(1, len(corners)))
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        # One array per coordinate, so that the innermost axis is that of the triangles.
        x, y, z = points[part].T[:, :, None, None] - np.moveaxis(corners, 2, 0)[:, None]
        (ax, bx, cx), (ay, by, cy), (az, bz, cz) = (np.moveaxis(v, 2, 0) for v in (x, y, z))
        la, lb, lc = np.moveaxis(np.sqrt(x * x + y * y + z * z), 2, 0)
        above = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        below = la * lb * lc + (ax * bx + ay * by + az * bz) * lc
        below += (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb
        # The sides are taken from the point outwards, which changes the sign of the solid angles.
        found[part] = np.arctan2(-above, below).sum(axis=1) / (2 * np.pi)
    return found


def nearest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """(n, 3) nearest point on each triangle (n, 3, 3) to the point (n, 3) of the same number."""
    from trimesh import triangles

    closest: Callable[..., Floats] = triangles.closest_point
    return np.asarray(closest(corners, points), dtype=np.float64)
