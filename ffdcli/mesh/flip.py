"""Flips of the inner edges of flat faces; Delaunay triangulation by flips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
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
        chosen = without_neighbours(net, edges)
        flipped = net.beside[chosen].ravel() // 3
        net = flip(net, chosen)
        changed[flipped] = True
        asked = np.concatenate([edges, net.sides[flipped].ravel()])
    return net, changed


def without_neighbours(net: TriangleNet, edges: Ints) -> Ints:
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


def flip(net: TriangleNet, edges: Ints) -> TriangleNet:
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
