"""Which polygon corners share an edge, all at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def next_corners(starts: Ints) -> Ints:
    """(C,) index of the corner that follows each corner round its polygon."""
    count = int(starts[-1])
    following = np.arange(1, count + 1)
    following[starts[1:] - 1] = starts[:-1]
    return following


def edge_keys(tails: Ints, heads: Ints, vertex_count: int) -> Ints:
    """One integer per undirected edge: equal for both directions."""
    return np.minimum(tails, heads) * np.int64(vertex_count) + np.maximum(tails, heads)


def find_twins(tails: Ints, heads: Ints, vertex_count: int) -> Ints:
    """(C,) the directed edge that runs the other way, -1 where there is not exactly one.

    An edge used once is open; one used more than twice, or twice the same way, has no twin.
    """
    keys = edge_keys(tails, heads, vertex_count)
    order = np.argsort(keys, kind="stable")
    ranked = keys[order]
    first = np.flatnonzero(np.r_[True, ranked[1:] != ranked[:-1]])
    pairs = first[np.diff(np.r_[first, len(ranked)]) == 2]
    left, right = order[pairs], order[pairs + 1]
    opposite = tails[left] == heads[right]
    twins = np.full(len(keys), -1, dtype=np.int64)
    twins[left[opposite]] = right[opposite]
    twins[right[opposite]] = left[opposite]
    return twins
