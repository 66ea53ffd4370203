"""Axes of the bounding box of least volume."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats


def smallest_box(points: Floats) -> Floats:
    """(3, 3) right-handed unit axes, as rows, of a box of least volume round points (m, 3).

    trimesh searches the faces of the convex hull. The longest side comes first; the largest
    component of each axis is positive.
    """
    from trimesh.bounds import oriented_bounds

    to_box, extent = oriented_bounds(points)  # type: ignore[no-untyped-call]
    axes = np.asarray(to_box, dtype=np.float64)[:3, :3][np.argsort(-np.asarray(extent))]
    axes = axes * np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    # The axes of the search carry rounding errors: make them orthonormal.
    left, _, right = np.linalg.svd(axes)
    return np.asarray(left @ right)
