"""Coplanar triangles that lie on one another round a vertex."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.surface.planes import PlaneGroups

# What rounding adds to the angles round a vertex, radians.
_ROUNDING = 1e-9


def overlapping_polygons(
    vertices: Floats, triangles: Ints, polygon: Ints, groups: PlaneGroups
) -> Ints:
    """(T,) labels by which polygons that overlap others of their plane stand apart; 0 elsewhere.

    Where the angles of a group at a vertex add up to more than a full turn, its polygons there lie
    on one another: slivers of a mesh that is folded by a little. As one face they would have an
    outline that crosses itself.

    Parameters
    ----------
    vertices : (V, 3) float64
        In the frame of the planes.
    triangles : (T, 3) int64
    polygon : (T,) int64
        Polygon of each triangle.
    groups : PlaneGroups
    """
    # Two triangles make no more than a full turn.
    chosen = np.flatnonzero((np.bincount(groups.group) > 2)[groups.group])
    group, used = groups.group[chosen], triangles[chosen]
    corners, normal = vertices[used], groups.normal[group]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    turned = np.einsum("tcj,tj->tc", np.cross(ahead, behind), normal)
    lifted = np.einsum("tcj,tj->tc", ahead, normal) * np.einsum("tcj,tj->tc", behind, normal)
    # The angle between the sides, projected into the plane; negative in a triangle turned over.
    angle = np.arctan2(turned, np.einsum("tcj,tcj->tc", ahead, behind) - lifted)
    _, at = np.unique(group[:, None] * np.int64(len(vertices)) + used, return_inverse=True)
    whole = np.bincount(at.ravel(), weights=angle.ravel())
    overfull = (whole > 2 * np.pi + _ROUNDING)[at.reshape(used.shape)].any(axis=1)
    apart = np.isin(polygon, polygon[chosen[overfull]])
    return np.where(apart, polygon + 1, 0)
