"""Turned boxes round points."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats


def smallest_box(points: Floats) -> Floats:
    """Rows: right-handed unit axes of a box of least volume round points (m, 3).

    By trimesh's search over the faces of the convex hull. Each axis points the way its largest
    component is positive, the longest side comes first.
    """
    from trimesh.bounds import oriented_bounds

    to_box, extent = oriented_bounds(points)  # type: ignore[no-untyped-call]
    axes = np.asarray(to_box, dtype=np.float64)[:3, :3][np.argsort(-np.asarray(extent))]
    axes = axes * np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    # The search works with turned copies; make them orthonormal to the last bit.
    left, _, right = np.linalg.svd(axes)
    return np.asarray(left @ right)
