"""Triangles thinner than the noise of the mesh, whose normals mean nothing.

They may face away from the plane of their group, or stand edge-on to it. Then the outline of the
group turns back on itself there: by a notch along the longest side of a needle, which is narrow, or
along the needle, which is a spike: then one side joins it to the group, and not its longest.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import find_twins
from ffdcli.graphs import connected_components

# An axis may be dominant where its normal component is at least this share of the largest.
DOMINANCE = 0.5


def triangle_areas(vertices: Floats, triangles: Ints) -> Floats:
    """(T, 3) vector areas of triangles."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


def is_needle(vertices: Floats, triangles: Ints, delta: float) -> Bools:
    """(T,) True for triangles thinner than twice delta, whose normals are noise."""
    return altitudes(vertices, triangles) <= 2 * delta


def altitudes(vertices: Floats, triangles: Ints) -> Floats:
    """(T,) least altitudes of triangles, model length."""
    length = np.linalg.norm(triangle_areas(vertices, triangles), axis=1)
    longest = np.sqrt(_squared_sides(vertices, triangles).max(axis=1))
    return np.asarray(2 * length / np.where(longest > 0, longest, 1.0))


def faces_away(area: Floats, normal: Floats) -> Bools:
    """(m,) True for triangles that are not seen from the front along an axis that may be dominant.

    Parameters
    ----------
    area : (m, 3) float64
        Vector areas.
    normal : (3,) or (m, 3) float64
        Normals of their planes.
    """
    share = np.abs(normal) >= DOMINANCE * np.abs(normal).max(axis=-1, keepdims=True)
    return np.asarray(((np.sign(normal) * area <= 0) & share).any(axis=-1))


def is_spike(shared: Bools) -> Bools:
    """(m,) True for needles joined to a group by one side alone, and that not the longest.

    Parameters
    ----------
    shared : (m, 3) bool
        Sides that triangles of the group lie beyond, the longest first.
    """
    return np.asarray((shared.sum(axis=1) == 1) & ~shared[:, 0])


def beyond_sides(vertices: Floats, triangles: Ints, sides: Ints) -> Ints:
    """(T, 3) the triangle beyond each side of each, the longest side first; -1 for none.

    Parameters
    ----------
    vertices : (V, 3) float64
    triangles, sides : (T, 3) int64
        ``sides`` are the numbers of their edges.
    """
    twins = find_twins(sides.ravel(), triangles.ravel()).reshape(-1, 3)
    order = np.argsort(-_squared_sides(vertices, triangles), axis=1, kind="stable")
    return np.take_along_axis(np.where(twins >= 0, twins // 3, -1), order, axis=1)


def fold_width(
    vertices: Floats, triangles: Ints, sides: Ints, group: Ints, axes: Ints, delta: float
) -> float:
    """How far needles that face away from their plane reach beyond the outline of their group.

    That is at most the sum of the altitudes of those that lie side by side.

    Parameters
    ----------
    vertices : (V, 3) float64
    triangles, sides : (T, 3) int64
    group : (T,) int64
    axes : (G, 3) int64
        Of the planes as graphs (:class:`ffdcli.surface.plane_graphs.PlaneGraphs`).
    delta : float, model length
    """
    high = altitudes(vertices, triangles)
    dominant = axes[group, 0]
    front = np.where((axes[group, 1] - dominant) % 3 == 1, 1.0, -1.0)
    seen = triangle_areas(vertices, triangles)[np.arange(len(triangles)), dominant] * front
    members = np.flatnonzero((seen <= 0) & (high <= 2 * delta))
    if not len(members):
        return 0.0
    beyond = beyond_sides(vertices, triangles, sides)[members]
    local = np.full(len(triangles) + 1, -1)
    local[members] = np.arange(len(members))
    beside = local[beyond]
    one, side = np.nonzero((beside >= 0) & (group[beyond] == group[members, None]))
    family = connected_components(len(members), one, beside[one, side])
    return float(np.bincount(family, weights=high[members]).max())


def _squared_sides(vertices: Floats, triangles: Ints) -> Floats:
    sides = vertices[np.roll(triangles, -1, axis=1)] - vertices[triangles]
    return np.asarray((sides**2).sum(axis=2))
