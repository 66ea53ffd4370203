"""Flips of the inner edges of flat faces, to make them Delaunay or to clear diagonals.

A diagonal of a split polygon is an edge of the mesh. Two bent polygons that share two vertices, for
example because they meet along several edges, must not both be split along the line between these
vertices, nor may one be if an edge joins them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import edge_keys
from ffdcli.mesh.triangle_net import TriangleNet

# An edge is flipped if its opposite angles exceed a half turn by this much, as a sine.
_SLACK = 1e-9
# Lawson's flips end in exact arithmetic; the limit guards against rounding.
_MOST_PASSES = 200


def flip_to_delaunay(net: TriangleNet, suspect: Bools | None = None) -> tuple[TriangleNet, Bools]:
    """Flip inner edges until the angles opposite each add up to at most a half turn.

    Each pass flips all edges that are the worst of both their triangles: Lawson's algorithm (1977),
    many edges at once.

    Parameters
    ----------
    suspect : (T,) bool, optional
        Triangles that may not be Delaunay; all by default.

    Returns
    -------
    TriangleNet
        The same vertices and edge numbers.
    (T,) bool
        Triangles that changed.
    """
    changed = np.zeros(len(net.triangles), dtype=bool)
    asked = (net.sides if suspect is None else net.sides[suspect]).ravel()
    for _ in range(_MOST_PASSES):
        edges = np.unique(asked)
        edges = edges[net.inner[edges]]
        excess = _excess(net, edges)
        open_ = np.flatnonzero(excess > _SLACK)
        edges = edges[open_[np.argsort(-excess[open_], kind="stable")]]
        if not len(edges):
            break
        chosen = _without_neighbours(net, edges)
        flipped = net.beside[chosen].ravel() // 3
        net = _flip(net, chosen)
        changed[flipped] = True
        asked = np.concatenate([edges, net.sides[flipped].ravel()])
    return net, changed


def _without_neighbours(net: TriangleNet, edges: Ints) -> Ints:
    """Inner edges that come first, in the given order, in both their triangles."""
    rank = np.arange(len(edges))
    pair = net.beside[edges] // 3
    best = np.full(len(net.triangles), len(edges))
    np.minimum.at(best, pair.ravel(), np.repeat(rank, 2))
    return edges[(best[pair] == rank[:, None]).all(axis=1)]


def _excess(net: TriangleNet, edges: Ints) -> Floats:
    """(n,) minus the sine of the sum of the two angles opposite each edge, all in one plane."""
    sine, cosine = [], []
    for place in range(2):
        side = net.beside[edges, place]
        corner = net.rest[net.triangles[side // 3]]
        turn = (side[:, None] % 3 + np.arange(3)) % 3
        corner = np.take_along_axis(corner, turn[:, :, None], axis=1)
        arms = corner[:, :2] - corner[:, 2:]
        size = np.linalg.norm(arms, axis=2).prod(axis=1)
        size = np.where(size > 0, size, 1.0)
        sine.append(np.linalg.norm(np.cross(arms[:, 0], arms[:, 1]), axis=1) / size)
        cosine.append(np.einsum("ij,ij->i", arms[:, 0], arms[:, 1]) / size)
    return np.asarray(-(sine[0] * cosine[1] + cosine[0] * sine[1]))


def _flip(net: TriangleNet, edges: Ints) -> TriangleNet:
    """Flip inner edges, no two of which share a triangle."""
    triangles, sides, ends = net.triangles.copy(), net.sides.copy(), net.ends.copy()
    one, other = net.beside[edges].T
    t, u = one // 3, other // 3
    ahead, behind = (one + 1) % 3, (one + 2) % 3
    ahead_u, behind_u = (other + 1) % 3, (other + 2) % 3
    a, b, c = triangles[t, one % 3], triangles[t, ahead], triangles[t, behind]
    d = triangles[u, behind_u]
    to_c, from_c = sides[t, ahead], sides[t, behind]
    to_d, from_d = sides[u, ahead_u], sides[u, behind_u]
    triangles[t], sides[t] = np.stack([a, d, c], 1), np.stack([to_d, edges, from_c], 1)
    triangles[u], sides[u] = np.stack([d, b, c], 1), np.stack([from_d, to_c, edges], 1)
    ends[edges] = np.stack([c, d], 1)
    return replace(net, triangles=triangles, sides=sides, ends=ends)


def are_proper(corners: Floats, normals: Floats) -> Bools:
    """Whether triangles (..., 3, 3) face along normals (..., 3), with an area above rounding error.

    Normals have any length; no triangle is proper for a normal of 0.
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
        edges = _without_neighbours(net, edges[~stuck[edges]])
        if not len(edges):
            return net
        trial = _flip(net, edges)
        ends = vertex[trial.ends[edges]]
        made = edge_keys(ends[:, 0], ends[:, 1], count)
        free = ~np.isin(made, taken) & ~np.isin(made, keys)
        free[np.setdiff1d(np.arange(len(made)), np.unique(made, return_index=True)[1])] = False
        pair = net.beside[edges] // 3
        free &= are_proper(net.rest[trial.triangles[pair]], normals[pair]).all(axis=1)
        stuck[edges[~free]] = True
        net = _flip(net, edges[free])
