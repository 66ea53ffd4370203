"""Where points lie to triangles: how often these wind round them, and the nearest place on them."""

from __future__ import annotations

import numpy as np

from ffdcli.mesh.record import Floats

# Pairs of a point and a triangle looked at together: bounds the memory.
_PAIRS = 500_000


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
        a, b, c = np.moveaxis(corners[None] - points[part, None, None], 2, 0)
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        above = np.einsum("nij,nij->ni", a, np.cross(b, c))
        below = la * lb * lc
        for pair, length in (((a, b), lc), ((b, c), la), ((c, a), lb)):
            below += np.einsum("nij,nij->ni", *pair) * length
        found[part] = np.arctan2(above, below).sum(axis=1) / (2 * np.pi)
    return found


def nearest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """(n, 3) the place on each triangle (n, 3, 3) that is nearest to the point (n, 3) beside it."""
    from trimesh.triangles import closest_point

    return np.asarray(closest_point(corners, points), dtype=np.float64)
