"""Cut triangles into triangles at all knot planes that they cross (Feng et al. 1998).

Each triangle is cut separately, and quadrangles are split into two triangles at once. The pieces
are the "old" sub-polygons of Feng 2002, Table 2.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh import Mesh, triangles
from ffdcli.volume.protocol import Volume


def cut_mesh(mesh: Mesh, volume: Volume) -> tuple[Floats, Bools]:
    """Cut the triangles of a mesh at the sides of the lattice box and at knot planes.

    Returns
    -------
    (N, 3, 3) float64, lattice frame
    (N,) bool
        Triangles inside the box.
    """
    corners, _ = triangles(mesh)
    local = volume.frame.to_local(mesh.vertices)[corners]
    pieces, _ = cut_into_triangles(local, volume, mesh.delta)
    middle = pieces.mean(axis=1)
    low, high = volume.box[0] - mesh.delta, volume.box[1] + mesh.delta
    return pieces, np.all((middle >= low) & (middle <= high), axis=1)


def cut_into_triangles(corners: Floats, volume: Volume, snap: float) -> tuple[Floats, Ints]:
    """Cut triangles at the sides of the lattice box and at the knot planes that each one meets.

    On an octree these are the sides of the cells that the bounding box of the triangle meets.

    Parameters
    ----------
    corners : (T, 3, 3) float64, lattice frame
    volume : Volume
    snap : float
        Corners closer to a plane than this lie on it.

    Returns
    -------
    (N, 3, 3) float64
    (N,) int64
        Original triangle of each.
    """
    origin = np.arange(len(corners))
    for axis in range(3):
        for value in volume.box[:, axis]:
            every = np.ones(len(corners), dtype=bool)
            corners, whole = _cut(corners, every, axis, float(value), snap)
            origin = origin[whole]
    for axis in range(3):
        boxes = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
        planes = volume.knot_planes(axis, boxes).values
        whole = np.arange(len(corners))
        for value in np.unique(planes[~np.isnan(planes)]):
            meets = (planes == value).any(axis=1)
            corners, part = _cut(corners, meets[whole], axis, float(value), snap)
            whole = whole[part]
        origin = origin[whole]
    return corners, origin


def _cut(
    corners: Floats, chosen: Bools, axis: int, value: float, snap: float
) -> tuple[Floats, Ints]:
    """Cut the chosen triangles that have corners on both sides of a plane."""
    origin = np.arange(len(corners))
    offset = corners[:, :, axis] - value
    side = np.where(np.abs(offset) <= snap, 0, np.sign(offset))
    hit = chosen & (side.min(axis=1) < 0) & (side.max(axis=1) > 0)
    touching = hit & (side == 0).any(axis=1)
    crossing = hit & ~touching

    # The plane passes through a corner: rotate it to the front; the opposite side is cut.
    lead, at = _rotated(corners, offset, np.argmax(side == 0, axis=1), touching)
    on = _crossing(lead, at, 1, 2, axis, value)
    halves = [
        np.stack([lead[:, 0], lead[:, 1], on], axis=1),
        np.stack([lead[:, 0], on, lead[:, 2]], axis=1),
    ]
    # One corner alone on its side: the cut leaves a triangle, and a quadrangle, which is split.
    alone = np.argmax(side * np.sign(side.sum(axis=1, keepdims=True)) < 0, axis=1)
    lead, at = _rotated(corners, offset, alone, crossing)
    p, q = (_crossing(lead, at, 0, i, axis, value) for i in (1, 2))
    thirds = [
        np.stack([lead[:, 0], p, q], axis=1),
        np.stack([p, lead[:, 1], lead[:, 2]], axis=1),
        np.stack([p, lead[:, 2], q], axis=1),
    ]
    return (
        np.concatenate([corners[~hit], *halves, *thirds]),
        np.concatenate([origin[~hit], *2 * [origin[touching]], *3 * [origin[crossing]]]),
    )


def _rotated(corners: Floats, offset: Floats, first: Ints, chosen: Bools) -> tuple[Floats, Floats]:
    """The chosen triangles and their offsets from the plane, starting at corner ``first``."""
    turn = (first[chosen, None] + np.arange(3)) % 3
    return (
        np.take_along_axis(corners[chosen], turn[:, :, None], axis=1),
        np.take_along_axis(offset[chosen], turn, axis=1),
    )


def _crossing(corners: Floats, offset: Floats, i: int, j: int, axis: int, value: float) -> Floats:
    """Intersections of the sides from corner i to corner j with the plane."""
    share = (offset[:, i] / (offset[:, i] - offset[:, j]))[:, None]
    points = corners[:, i] + share * (corners[:, j] - corners[:, i])
    points[:, axis] = value
    return np.asarray(points)
