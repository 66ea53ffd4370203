"""Which sides of polygons and triangles share an edge, all at once."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Ints


def next_corners(starts: Ints) -> Ints:
    """(C,) index of the corner that follows each corner round its polygon."""
    count = int(starts[-1])
    following = np.arange(1, count + 1)
    following[starts[1:] - 1] = starts[:-1]
    return following


def edge_keys(tails: Ints, heads: Ints, vertex_count: int) -> Ints:
    """One integer per undirected edge: equal for both directions."""
    return np.minimum(tails, heads) * np.int64(vertex_count) + np.maximum(tails, heads)


def number_sides(triangles: Ints, polygon: Ints, vertex_count: int) -> Ints:
    """(T, 3) edge from each corner of a triangle to the next, numbered from 0.

    Sides on the same two vertices share an edge. A diagonal, along which two triangles of one
    polygon meet, is an edge of its own all the same: it may join vertices that others join too, as
    where corners lie in a row or bodies touch.

    Parameters
    ----------
    triangles : (T, 3) int64
    polygon : (T,) int64
        What each triangle is part of.
    """
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    _, edge, uses = np.unique(
        edge_keys(tails, heads, vertex_count), return_inverse=True, return_counts=True
    )
    # Where two sides alone meet, diagonal or not, there is nothing to be told apart.
    crowded = np.flatnonzero(uses[edge] > 2)
    if len(crowded):
        where = np.column_stack([edge[crowded], polygon[crowded // 3]])
        _, here = np.unique(where, axis=0, return_inverse=True)
        way = 2 * here.ravel() + (tails[crowded] < heads[crowded])
        order = np.argsort(way, kind="stable")
        first = np.searchsorted(way[order], way)
        rank = np.empty(len(way), dtype=np.int64)
        rank[order] = np.arange(len(way))
        # The first side one way belongs to the first one back, and so on; some are left over.
        pairs = np.column_stack([way // 2, rank - first])
        _, pair, sides = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        within = sides[pair.ravel()] == 2
        edge[crowded[within]] = len(uses) + pair.ravel()[within]
        _, edge = np.unique(edge, return_inverse=True)
    return np.asarray(edge.reshape(-1, 3), dtype=np.int64)


def find_twins(edges: Ints, tails: Ints) -> Ints:
    """(C,) the other side along each side's edge, -1 where there is not exactly one, opposite.

    An edge used once is open; one used more than twice, or twice the same way, has no twins.

    Parameters
    ----------
    edges : (C,) int64
        Number of the edge along each side.
    tails : (C,) int64
        Vertex where each side begins.
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
