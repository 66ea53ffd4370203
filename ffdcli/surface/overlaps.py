"""Coplanar polygons that lie on one another, so that one outline would cross itself."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.boxes import meeting_boxes
from ffdcli.segments import crossing_points
from ffdcli.surface.needles import DOMINANCE, triangle_areas
from ffdcli.surface.planes import PlaneGroups

# What rounding adds to the angles round a vertex, radians.
_ROUNDING = 1e-9


def overlapping_polygons(
    vertices: Floats, triangles: Ints, polygon: Ints, groups: PlaneGroups
) -> Ints:
    """(T,) labels by which polygons that overlap others of their plane stand apart; 0 elsewhere.

    These are parts of a mesh that is folded by a little. Either the angles of a group at a vertex
    add up to more than a full turn, or sides on its outline cross: then the smaller of both
    triangles leaves, until none cross.

    Parameters
    ----------
    vertices : (V, 3) float64
        In the frame of the planes.
    triangles : (T, 3) int64
    polygon : (T,) int64
        Polygon of each triangle.
    groups : PlaneGroups
    """
    labels = np.where(_overfull(vertices, triangles, polygon, groups), polygon + 1, 0)
    # Two triangles make no outline that crosses itself.
    asked = np.bincount(groups.group) > 2
    while asked.any():
        leaving = _crossing(vertices, triangles, polygon, groups, asked, labels)
        asked = np.zeros(len(asked), dtype=bool)
        asked[groups.group[leaving]] = True
        labels[leaving] = polygon[leaving] + 1
    return labels


def _overfull(vertices: Floats, triangles: Ints, polygon: Ints, groups: PlaneGroups) -> Bools:
    """(T,) True for polygons at a vertex where the angles of a group exceed a full turn."""
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
    return np.isin(polygon, polygon[chosen[overfull]])


def _crossing(
    vertices: Floats,
    triangles: Ints,
    polygon: Ints,
    groups: PlaneGroups,
    asked: Bools,
    labels: Ints,
) -> Ints:
    """Triangles of polygons that are to leave groups (G,) that are asked for.

    Outlines are seen along every axis that may become the dominant one. Groups without the
    polygons that have left have the label 0.
    """
    chosen = np.flatnonzero(asked[groups.group] & (labels == 0))
    keys = groups.group[chosen, None] * np.int64(groups.sides.max() + 1) + groups.sides[chosen]
    _, at, uses = np.unique(keys, return_inverse=True, return_counts=True)
    place, corner = np.nonzero(uses[at.reshape(keys.shape)] == 1)
    owner = chosen[place]
    tails, heads = triangles[owner, corner], triangles[owner, (corner + 1) % 3]
    normal = np.abs(groups.normal[groups.group[owner]])
    usable = normal >= DOMINANCE * normal.max(axis=1, keepdims=True)
    found = [np.zeros((0, 2), dtype=np.int64)]
    for axis in range(3):
        seen = np.flatnonzero(usable[:, axis])
        plane = np.delete(vertices, axis, axis=1)
        pairs = _crossing_sides(plane[tails[seen]], plane[heads[seen]], groups.group[owner[seen]])
        found.append(owner[seen[pairs]])
    both = np.concatenate(found)
    both = both[polygon[both[:, 0]] != polygon[both[:, 1]]]
    area = np.linalg.norm(triangle_areas(vertices, triangles[both.ravel()]), axis=1).reshape(-1, 2)
    smaller = both[np.arange(len(both)), area.argmin(axis=1)]
    return np.flatnonzero(np.isin(polygon, polygon[smaller]))


def _crossing_sides(tails: Floats, heads: Floats, group: Ints) -> Ints:
    """(p, 2) pairs of sides (n, 2) of one group that cross within both."""
    level = group[:, None] + np.array([[0.0, 0.5]])
    low = np.column_stack([np.minimum(tails, heads), level[:, 0]])
    high = np.column_stack([np.maximum(tails, heads), level[:, 1]])
    pairs = meeting_boxes(low, high)
    (a, c), (b, d) = tails[pairs].swapaxes(0, 1), heads[pairs].swapaxes(0, 1)
    return pairs[~np.isnan(crossing_points(a, b, c, d)[:, 0])]
