"""Diagonals of split polygons that would coincide with other edges, moved by flips.

A diagonal of a split polygon is an edge of the mesh. Two bent polygons that share two vertices, for
example because they meet along several edges, must not both be split along the line between these
vertices, nor may one be if an edge joins them.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import edge_keys
from ffdcli.mesh.flip import flip, without_neighbours
from ffdcli.mesh.triangle_net import TriangleNet


def are_proper(corners: Floats, normals: Floats) -> Bools:
    """Whether triangles face along normals, with an area above rounding error.

    Parameters
    ----------
    corners : (..., 3, 3) float64, model length
    normals : (..., 3) float64
        Of any length; no triangle is proper for a normal of 0.
    """
    sides = np.roll(corners, -1, axis=-2) - corners
    perimeter = np.linalg.norm(sides, axis=-1).sum(axis=-1)
    turns = np.einsum("...i,...i->...", np.cross(sides[..., 0, :], sides[..., 1, :]), normals)
    # Each coordinate is rounded by half a unit in the last place, as in `find_degenerate`.
    rounding = 8 * np.spacing(np.abs(corners).max(initial=0.0))
    return np.asarray(turns > rounding * perimeter * np.linalg.norm(normals, axis=-1))


def clear_diagonals(
    net: TriangleNet, normals: Floats, vertex: Ints, taken: Ints, count: int
) -> TriangleNet:
    """Flip the diagonals between vertices that an edge or another diagonal joins already.

    Diagonals that cannot be flipped stay.

    Parameters
    ----------
    net : TriangleNet
        Triangles of polygons, on their corners.
    normals : (T, 3) float64
        Normal of the polygon of each triangle.
    vertex : (C,) int64
        Vertex of each corner.
    taken : (n,) int64
        Keys of the edges of all polygons, by `edge_keys`.
    count : int
        Number of vertices, for the keys.
    """
    stuck = np.zeros(len(net.ends), dtype=bool)
    while True:
        inner = np.flatnonzero(net.inner)
        ends = vertex[net.ends[inner]]
        keys = edge_keys(ends[:, 0], ends[:, 1], count)
        # Of several on the same vertices one stays, preferably one that cannot be flipped.
        order = np.lexsort([~stuck[inner], keys])
        again = np.r_[False, np.diff(keys[order]) == 0] | np.isin(keys[order], taken)
        edges = inner[order][again]
        edges = without_neighbours(net, edges[~stuck[edges]])
        if not len(edges):
            return net
        trial = flip(net, edges)
        ends = vertex[trial.ends[edges]]
        made = edge_keys(ends[:, 0], ends[:, 1], count)
        free = ~np.isin(made, taken) & ~np.isin(made, keys)
        free[np.setdiff1d(np.arange(len(made)), np.unique(made, return_index=True)[1])] = False
        pair = net.beside[edges] // 3
        free &= are_proper(net.rest[trial.triangles[pair]], normals[pair]).all(axis=1)
        stuck[edges[~free]] = True
        net = flip(net, edges[free])
