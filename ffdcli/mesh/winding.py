"""Where points lie to triangles: how often these wind round them, and the nearest place on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffdcli.arrays import Floats

# Pairs of a point and a triangle looked at together: bounds the memory.
_PAIRS = 50_000


def winding_numbers(points: Floats, corners: Floats) -> Floats:
    """How often triangles wind round points: 1 inside a closed outward surface, 0 outside.

    Parameters
    ----------
    points : (n, 3) float64
    corners : (T, 3, 3) float64

    Returns
    -------
    (n,) float64
        Whole numbers, to rounding, where the triangles are closed and the points not on them.

    Notes
    -----
    Generalised winding number by solid angles (van Oosterom and Strackee 1983, eq. 8).
    """
    found = np.zeros(len(points))
    step = max(1, _PAIRS // max(1, len(corners)))
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        # One array per coordinate, so that all loops run over the triangles.
        x, y, z = points[part].T[:, :, None, None] - np.moveaxis(corners, 2, 0)[:, None]
        (ax, bx, cx), (ay, by, cy), (az, bz, cz) = (np.moveaxis(v, 2, 0) for v in (x, y, z))
        la, lb, lc = np.moveaxis(np.sqrt(x * x + y * y + z * z), 2, 0)
        above = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        below = la * lb * lc + (ax * bx + ay * by + az * bz) * lc
        below += (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb
        # Seen from the point the sides change their sense, and the solid angles their sign.
        found[part] = np.arctan2(-above, below).sum(axis=1) / (2 * np.pi)
    return found


def nearest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """(n, 3) the place on each triangle (n, 3, 3) that is nearest to the point (n, 3) beside it."""
    from trimesh import triangles

    closest: Callable[..., Floats] = triangles.closest_point
    return np.asarray(closest(corners, points), dtype=np.float64)
