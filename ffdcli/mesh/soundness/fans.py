"""Fans: polygon corners connected round a vertex; surfaces that touch are separated by them.

A vertex with two fans joins surfaces that touch in a point; an edge with four polygons joins two
surfaces that touch along a line. A vertex of its own for each fan separates them in place.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import next_corners
from ffdcli.graphs import connected_components
from ffdcli.mesh.edges import EdgeUses
from ffdcli.mesh.polygons import area_vectors
from ffdcli.mesh.record import Mesh

# Polygons on one edge coincide if their angle, in radians, is below this plus the angle that the
# weld reach makes over the height of the polygon.
_SAME_ANGLE = 1e-9


def label_fans(mesh: Mesh, edges: EdgeUses, pairs: Ints | None = None) -> Ints:
    """(C,) fan of each polygon corner, numbered in the order of their first corners.

    Parameters
    ----------
    pairs : (n, 2) int64, optional
        Corners at whose edges two polygons are connected. Two polygons alone on an edge are always
        connected, and so are all polygons on other edges, and the open surfaces whose boundaries
        meet in a vertex.
    """
    following = next_corners(mesh.starts)
    paired = np.zeros(len(edges.ends), dtype=bool)
    if pairs is not None:
        paired[edges.edge_of_corner[pairs]] = True
    order = np.argsort(edges.edge_of_corner, kind="stable")
    same = np.flatnonzero(np.diff(edges.edge_of_corner[order]) == 0)
    links = np.column_stack([order[same], order[same + 1]])
    links = links[~paired[edges.edge_of_corner[links[:, 0]]]]
    if pairs is not None:
        links = np.concatenate([links, pairs])
    first, second = links.T
    # Match the ends of the edge by vertex: two polygons may run along it in one sense.
    alike = mesh.corners[first] == mesh.corners[second]
    there = np.where(alike, second, following[second])
    beyond = np.where(alike, following[second], second)
    border = np.flatnonzero(edges.uses[edges.edge_of_corner] == 1)
    border = np.concatenate([border, following[border]])
    border = border[np.argsort(mesh.corners[border], kind="stable")]
    meet = np.flatnonzero(np.diff(mesh.corners[border]) == 0)
    rows = np.concatenate([first, following[first], border[meet]])
    columns = np.concatenate([there, beyond, border[meet + 1]])
    return connected_components(len(mesh.corners), rows, columns)


def find_pinched(mesh: Mesh, edges: EdgeUses) -> Ints:
    """(n,) vertices with more than one fan, where surfaces touch in a point."""
    fans = np.unique(np.column_stack([label_fans(mesh, edges), mesh.corners]), axis=0)
    return np.flatnonzero(np.bincount(fans[:, 1], minlength=len(mesh.vertices)) > 1)


def pair_polygons(mesh: Mesh, edges: EdgeUses, reach: float) -> Ints:
    """Pairs of polygons that bound the same material at edges along which bodies touch.

    Round such an edge polygons that enter material alternate with polygons that leave it, and two
    with material between them are a pair. An edge without this order gives no pairs.

    Parameters
    ----------
    reach : float, model length
        Distance within which points of two polygons may be the same.

    Returns
    -------
    (n, 2) int64
        Corners at which the edge begins in each of the two polygons.
    """
    ends = mesh.vertices[edges.ends]
    crowded = (edges.uses > 2) & (2 * edges.forward == edges.uses)
    crowded &= (ends[:, 0] != ends[:, 1]).any(axis=1)
    corners = np.flatnonzero(crowded[edges.edge_of_corner])
    if not len(corners):
        return np.empty((0, 2), dtype=np.int64)
    edge = edges.edge_of_corner[corners]
    corners = corners[np.argsort(edge, kind="stable")]
    edge = np.sort(edge)
    angle, slack, leaves = _angles(mesh, edges, corners, reach)
    pairs = [
        corners[around[order].reshape(-1, 2)]
        for around in np.split(np.arange(len(corners)), np.flatnonzero(np.diff(edge)) + 1)
        if (order := _alternate(angle[around], slack[around], leaves[around])) is not None
    ]
    return np.concatenate(pairs) if pairs else np.empty((0, 2), dtype=np.int64)


def _angles(
    mesh: Mesh, edges: EdgeUses, corners: Ints, reach: float
) -> tuple[Floats, Floats, Bools]:
    """(n,) angles of polygons round their edges, uncertainties, and whether material ends there."""
    normals = area_vectors(mesh.vertices, mesh.corners, mesh.starts)
    normal = normals[mesh.polygon_of_corner[corners]]
    area = np.linalg.norm(normal, axis=1)
    ends = mesh.vertices[edges.ends[edges.edge_of_corner[corners]]]
    axis = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(axis, axis=1)
    leaves = mesh.corners[corners] == edges.ends[edges.edge_of_corner[corners], 0]
    # From the edge into the polygon: to the left of its sense.
    inward = np.cross(normal, np.where(leaves[:, None], axis, -axis))
    # Two directions perpendicular to the edge, the same for all its polygons.
    least = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    first = np.cross(axis, least)
    second = np.cross(axis, first) / length[:, None]
    angle = np.arctan2(np.einsum("ij,ij->i", inward, second), np.einsum("ij,ij->i", inward, first))
    # Polygons without area have no angle, and may coincide with any other.
    slack = np.full(len(area), np.inf)
    np.divide(reach * length, 2 * area, out=slack, where=area > 0)
    slack += _SAME_ANGLE
    return angle, slack, leaves


def _alternate(angle: Floats, slack: Floats, leaves: Bools) -> Ints | None:
    """(n,) order in which polygons enter and leave material alternately; None if there is none."""
    order = np.argsort(angle, kind="stable")
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    # Begin behind the widest gap, so that coincident polygons stay together.
    order = np.roll(order, -1 - int(np.argmax(gaps)))
    turned = np.mod(angle[order] - angle[order[0]], 2 * np.pi)
    turned[0] = 0.0
    level = np.concatenate([[0], np.cumsum(np.diff(turned) > slack[order[1:]] + slack[order[:-1]])])
    # The first of coincident polygons may end material, as a wall between two bodies does, or begin
    # it.
    for begin in (True, False):
        inside = begin
        result: list[int] = []
        for group in range(int(level[-1]) + 1):
            waiting = order[level == group].tolist()
            while waiting:
                found = next((n for n in waiting if bool(leaves[n]) == inside), None)
                if found is None:
                    break
                waiting.remove(found)
                result.append(found)
                inside = not inside
            if waiting:
                break
        if len(result) == len(order):
            return np.array(result[1:] + result[:1] if begin else result, dtype=np.int64)
    return None


def split_fans(mesh: Mesh, edges: EdgeUses, pairs: Ints) -> Mesh:
    """The mesh with a vertex for each fan; the first fan keeps the old vertex."""
    fan = label_fans(mesh, edges, pairs)
    # A fan has only one vertex.
    vertex = np.empty(int(fan.max()) + 1, dtype=np.int64)
    vertex[fan] = mesh.corners
    order = np.argsort(vertex, kind="stable")
    again = np.r_[False, np.diff(vertex[order]) == 0]
    number = np.empty(len(vertex), dtype=np.int64)
    number[order] = vertex[order]
    number[order[again]] = len(mesh.vertices) + np.arange(np.count_nonzero(again))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[vertex[order[again]]]])
    every = np.arange(mesh.polygon_count)
    return mesh.rebuilt(vertices, number[fan], mesh.starts, every, np.arange(len(mesh.corners)))
