"""Control points whose basis functions do not vanish on a part of the object."""

from __future__ import annotations

import itertools

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.volume.convex_overlap import touches_boxes, triangle_directions
from ffdcli.volume.protocol import LatticeMap

# Number of pairs of triangle and control point tested at once, which bounds the memory.
_CHUNK = 200_000


def reaching_box(volume: LatticeMap, low: Floats, high: Floats) -> Bools:
    """(nu, nv, nw) control points that reach a box in model coordinates with corners (3,), (3,).

    The box may have no thickness along an axis.
    """
    share = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    corners = volume.frame.to_local(low + share * (high - low))
    axes = volume.frame.to_local(np.eye(3)) - volume.frame.to_local(np.zeros((1, 3)))
    first, last = volume.supports()
    count = len(first)
    found = touches_boxes(
        np.broadcast_to(corners, (count, 8, 3)),
        np.broadcast_to(axes, (count, 3, 3)),
        np.broadcast_to(axes, (count, 3, 3)),
        first,
        last,
    )
    return found.reshape(volume.shape)


def reaching_triangles(volume: LatticeMap, triangles: Floats) -> Bools:
    """(nu, nv, nw) control points that reach some triangle (T, 3, 3) in model coordinates."""
    local = volume.frame.to_local(triangles)
    first, last = volume.supports()
    found = np.zeros(len(first), dtype=bool)
    corners = local.reshape(-1, 3)
    at_corners = volume.basis_matrix(corners[volume.contains(corners)])
    found[at_corners.indices[at_corners.data > 0]] = True
    # Control points that only the inside of a triangle meets are among the remaining ones.
    low, high = local.min(axis=1), local.max(axis=1)
    normals, edges = triangle_directions(local)
    within = np.all((low.min(axis=0) <= last) & (high.max(axis=0) >= first), axis=1)
    open_points = np.flatnonzero(within & ~found)
    step = max(1, _CHUNK // len(local))
    for start in range(0, len(open_points), step):
        part = open_points[start : start + step]
        near = np.all((low[None] <= last[part, None]) & (high[None] >= first[part, None]), axis=-1)
        point, triangle = np.nonzero(near)
        meets = touches_boxes(
            local[triangle],
            normals[triangle],
            edges[triangle],
            first[part[point]],
            last[part[point]],
        )
        found[part[point[meets]]] = True
    return found.reshape(volume.shape)
