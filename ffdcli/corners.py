"""Sides of polygons and triangles, and the edges that they share."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Ints


def next_corners(starts: Ints) -> Ints:
    """(C,) next corner of each corner round its polygon."""
    count = int(starts[-1])
    following = np.arange(1, count + 1)
    following[starts[1:] - 1] = starts[:-1]
    return following


def edge_keys(tails: Ints, heads: Ints, vertex_count: int) -> Ints:
    """(n,) one integer per undirected edge, equal for both directions."""
    return np.minimum(tails, heads) * np.int64(vertex_count) + np.maximum(tails, heads)


def number_sides(triangles: Ints, polygon: Ints, vertex_count: int) -> Ints:
    """(T, 3) edge from each corner of a triangle to the next, numbered from 0.

    Sides on the same two vertices share an edge, except for diagonals: two triangles of one polygon
    share an edge that no other side has. Other edges may join the vertices of a diagonal if corners
    are collinear or bodies touch.

    Parameters
    ----------
    triangles : (T, 3) int64
    polygon : (T,) int64
        Polygon of each triangle.
    """
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    _, edge, uses = np.unique(
        edge_keys(tails, heads, vertex_count), return_inverse=True, return_counts=True
    )
    # Two sides alone on two vertices share an edge, diagonal or not.
    crowded = np.flatnonzero(uses[edge] > 2)
    if len(crowded):
        where = np.column_stack([edge[crowded], polygon[crowded // 3]])
        _, here = np.unique(where, axis=0, return_inverse=True)
        way = 2 * here.ravel() + (tails[crowded] < heads[crowded])
        order = np.argsort(way, kind="stable")
        first = np.searchsorted(way[order], way)
        rank = np.empty(len(way), dtype=np.int64)
        rank[order] = np.arange(len(way))
        # The first side in one direction pairs with the first in the other, and so on.
        pairs = np.column_stack([way // 2, rank - first])
        _, pair, sides = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        within = sides[pair.ravel()] == 2
        edge[crowded[within]] = len(uses) + pair.ravel()[within]
        _, edge = np.unique(edge, return_inverse=True)
    return np.asarray(edge.reshape(-1, 3), dtype=np.int64)


def find_twins(edges: Ints, tails: Ints) -> Ints:
    """(C,) other side of each side's edge; -1 unless it has exactly two sides of opposite sense.

    The sides (C,) lie along numbered edges, and begin at vertices.
    """
    order = np.argsort(edges, kind="stable")
    ranked = edges[order]
    first = np.flatnonzero(np.r_[True, ranked[1:] != ranked[:-1]])
    pairs = first[np.diff(np.r_[first, len(ranked)]) == 2]
    left, right = order[pairs], order[pairs + 1]
    opposite = tails[left] != tails[right]
    twins = np.full(len(edges), -1, dtype=np.int64)
    twins[left[opposite]] = right[opposite]
    twins[right[opposite]] = left[opposite]
    return twins
