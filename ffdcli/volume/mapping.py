"""The deformation as a map of model points: what everything beside the surfaces is measured by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ffdcli.volume.protocol import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
# (n, 3) -> (n, 3), or (n, 3, 3) for derivatives; both in model coordinates.
Map = Callable[[Floats], Floats]

# Points are on the lattice box within this many delta of the mesh.
SLACK = 16.0


def deformation(volume: Volume, slack: float) -> Map:
    """Direct evaluation, point by point, in model coordinates.

    Points on the box are inside, and the mesh's own points lie there; a rounding must not carry
    them out. So a point no further from the box than ``slack`` gets the deformation at the nearest
    point of the box, continued by its derivative.
    """
    frame = volume.frame

    def deform(points: Floats) -> Floats:
        local, beyond = _drawn_in(volume, frame.to_local(points), slack)
        images = volume.evaluate(local)
        off = np.flatnonzero(beyond.any(axis=1))
        slopes = volume.jacobian(local[off])
        images[off] += np.einsum("nij,nj->ni", slopes, beyond[off])
        return frame.to_model(images)

    return deform


def derivatives(volume: Volume, slack: float) -> Map:
    """Jacobians in model coordinates: the frame's axes turn both sides."""
    frame = volume.frame

    def jacobian(points: Floats) -> Floats:
        local = volume.jacobian(_drawn_in(volume, frame.to_local(points), slack)[0])
        return local if frame.aligned else frame.axes.T @ local @ frame.axes

    return jacobian


def count_pieces(volume: Volume, points: Floats) -> Ints:
    """(m,) at most how many polynomial pieces of the volume segments in each hull may cross.

    Parameters
    ----------
    points : (m, n, 3) float64, model length
        Corners of each hull.
    """
    local = volume.frame.to_local(points)
    low, high = local.min(axis=1), local.max(axis=1)
    pieces = np.ones(len(points), dtype=np.int64)
    for axis in range(3):
        inner = volume.knot_planes(axis, volume.box).values
        planes = np.unique(np.concatenate([inner, volume.box[:, axis]]))
        first = np.searchsorted(planes, low[:, axis], side="right")
        pieces += np.maximum(0, np.searchsorted(planes, high[:, axis], side="left") - first)
    return pieces


def _drawn_in(volume: Volume, local: Floats, slack: float) -> tuple[Floats, Floats]:
    """Points (n, 3) with those close to the box moved onto it, and what they were moved by."""
    nearest = np.clip(local, volume.box[0], volume.box[1])
    close = (np.abs(local - nearest) <= slack).all(axis=1, keepdims=True)
    return np.where(close, nearest, local), np.where(close, local - nearest, 0.0)
