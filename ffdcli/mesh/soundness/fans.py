"""Fans: the polygon corners that hang together round a vertex, across paired edges.

A vertex with two fans joins surfaces that touch in a point; an edge with four polygons joins two
surfaces that touch along a line. With a vertex for each fan they are apart, and nothing has moved.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import next_corners
from ffdcli.mesh.edges import EdgeUses
from ffdcli.mesh.polygons import area_vectors
from ffdcli.mesh.record import Mesh

# Angles, in radians, below which two polygons on one edge count as lying on one another, beside
# what the weld reach allows over the polygon's height.
_SAME_ANGLE = 1e-9


def label_fans(mesh: Mesh, edges: EdgeUses, pairs: Ints | None = None) -> Ints:
    """(C,) fan of each polygon corner, numbered in the order of their first corners.

    Parameters
    ----------
    mesh : Mesh
    edges : EdgeUses
    pairs : (n, 2) int64, optional
        Corners at whose edges two polygons hang together, beside those that two alone share. Other
        edges with more than two polygons keep them all together. So do the rims of open surfaces
        that meet in a vertex: those may.
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
    # Ends of the edge that are one vertex; a polygon may run along it either way.
    alike = mesh.corners[first] == mesh.corners[second]
    there = np.where(alike, second, following[second])
    beyond = np.where(alike, following[second], second)
    border = np.flatnonzero(edges.uses[edges.edge_of_corner] == 1)
    border = np.concatenate([border, following[border]])
    border = border[np.argsort(mesh.corners[border], kind="stable")]
    meet = np.flatnonzero(np.diff(mesh.corners[border]) == 0)
    rows = np.concatenate([first, following[first], border[meet]])
    columns = np.concatenate([there, beyond, border[meet + 1]])
    size = len(mesh.corners)
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(size, size))
    label: Ints = connected_components(graph, directed=False)[1].astype(np.int64)
    return label


def find_pinched(mesh: Mesh, edges: EdgeUses) -> Ints:
    """Vertices with more than one fan, where surfaces touch in a point."""
    fans = np.unique(np.column_stack([label_fans(mesh, edges), mesh.corners]), axis=0)
    return np.flatnonzero(np.bincount(fans[:, 1], minlength=len(mesh.vertices)) > 1)


def pair_polygons(mesh: Mesh, edges: EdgeUses, reach: float) -> Ints:
    """Tell apart the bodies that touch along edges: which polygons bound the same material there.

    Round such an edge, polygons that enter material and polygons that leave it alternate; each pair
    with material between belongs together. Where they do not alternate, nothing can be said.

    Parameters
    ----------
    mesh : Mesh
    edges : EdgeUses
    reach : float, model length
        Distance within which points of two polygons may be one.

    Returns
    -------
    (n, 2) int64
        Pairs of corners, each at the beginning of the edge in its polygon.
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
    """Angle of each polygon round its edge, its uncertainty, and whether material ends there."""
    normals = area_vectors(mesh.vertices, mesh.corners, mesh.starts)
    normal = normals[mesh.polygon_of_corner[corners]]
    area = np.linalg.norm(normal, axis=1)
    ends = mesh.vertices[edges.ends[edges.edge_of_corner[corners]]]
    axis = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(axis, axis=1)
    leaves = mesh.corners[corners] == edges.ends[edges.edge_of_corner[corners], 0]
    # From the edge into the polygon: to the left of the way round.
    inward = np.cross(normal, np.where(leaves[:, None], axis, -axis))
    # Any two directions square to the edge; one edge gives all its polygons the same ones.
    least = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    first = np.cross(axis, least)
    second = np.cross(axis, first) / length[:, None]
    angle = np.arctan2(np.einsum("ij,ij->i", inward, second), np.einsum("ij,ij->i", inward, first))
    # Polygons without area have no angle, and may lie on any other.
    slack = np.full(len(area), np.inf)
    np.divide(reach * length, 2 * area, out=slack, where=area > 0)
    slack += _SAME_ANGLE
    return angle, slack, leaves


def _alternate(angle: Floats, slack: Floats, leaves: Bools) -> Ints | None:
    """Order in which polygons enter and leave material by turns, the entering one first."""
    order = np.argsort(angle, kind="stable")
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    # Begin behind the widest gap, so that polygons on one another are not parted.
    order = np.roll(order, -1 - int(np.argmax(gaps)))
    turned = np.mod(angle[order] - angle[order[0]], 2 * np.pi)
    turned[0] = 0.0
    level = np.concatenate([[0], np.cumsum(np.diff(turned) > slack[order[1:]] + slack[order[:-1]])])
    # Of polygons on one another the first may end material, or begin it; a wall between two bodies
    # does the former.
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
    """The mesh with a vertex of its own for each fan; the first keeps the old one's place."""
    fan = label_fans(mesh, edges, pairs)
    # Fans by their vertex; a fan has one vertex only.
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
