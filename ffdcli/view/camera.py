"""Parallel projection for pictures: direction, middle and extent of the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats

# From the front, right and above: the usual view of parts in CAD.
DIRECTION = (0.75, -1.0, 0.6)


@dataclass(frozen=True)
class Look:
    """A parallel projection of points, up along z.

    Parameters
    ----------
    middle : (3,) float64, model length
        Point in the middle of the picture.
    toward, up : (3,) float64
        Unit vectors from the model to the eye, and upward in the picture.
    extent : (float, float), model length
        Width and height of the visible region.
    distance : float, model length
        Distance of the eye from the middle, outside the model.
    """

    middle: Floats
    toward: Floats
    up: Floats
    extent: tuple[float, float]
    distance: float


def look(points: Floats, toward: Floats) -> Look:
    """View of points (n, 3) from a direction."""
    toward = toward / np.linalg.norm(toward)
    right = np.cross([0.0, 0.0, 1.0], toward)
    if not right.any():
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(toward, right), toward])
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float(np.linalg.norm(high - low)) or 1.0
    # A minimal size for flat models seen from the edge.
    width, height = (max(float(extent), 1e-3 * size) for extent in (high - low)[:2])
    return Look((low + high) / 2 @ axes, toward, axes[1], (width, height), 4 * size)
