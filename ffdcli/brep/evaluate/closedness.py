"""Closedness and orientation read off the integers, by our own count."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Topology


def edge_uses(record: Topology) -> tuple[Ints, Ints]:
    """(E,) how many loops run each edge forwards, and how many backwards."""
    count = len(record.edges)
    forward = record.coedge_edge[record.coedge_forward]
    backward = record.coedge_edge[~record.coedge_forward]
    return np.bincount(forward, minlength=count), np.bincount(backward, minlength=count)


def edge_faults(record: Topology) -> tuple[Bools, Bools]:
    """(E,) edges at which the surface ends, and edges where faces meet wrongly.

    Wrongly: used twice in one sense (a neighbour is turned round), or by more than two faces.
    """
    forward, backward = edge_uses(record)
    used = forward + backward
    # An edge no face uses is litter, but the surface neither ends nor turns there.
    return used == 1, (forward > 1) | (backward > 1)


def unchained_loops(record: Topology) -> Ints:
    """Loops whose coedges do not each start at the vertex where the one before ends."""
    ends = record.edges[record.coedge_edge]
    backward = ~record.coedge_forward
    ends[backward] = ends[backward, ::-1]
    starts, stops = record.loop_coedges[:-1], record.loop_coedges[1:]
    filled = stops > starts
    following = np.arange(len(ends)) + 1
    following[stops[filled] - 1] = starts[filled]
    broken = ends[:, 1] != ends[following, 0]
    return np.unique(np.concatenate([record.loop_of_coedge[broken], np.flatnonzero(~filled)]))


def mesh_bodies(triangles: Ints) -> tuple[Ints, Bools, Ints]:
    """Bodies of a triangle mesh, pieces connected through edges, and who borders on whom.

    Parameters
    ----------
    triangles : (T, 3) int64

    Returns
    -------
    body : (T,) int64
        Body of each triangle.
    closed : (bodies,) bool
        True where every edge is used twice, in opposite senses.
    neighbours : (T, 3) int64
        Triangle across each side, -1 where there is none; side i starts at corner i.
    """
    count = len(triangles)
    start, stop = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    key = np.stack([np.minimum(start, stop), np.maximum(start, stop)], axis=1)
    _, edge = np.unique(key, axis=0, return_inverse=True)
    edge = edge.ravel()
    owner = np.repeat(np.arange(count), 3)
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(edge[order][1:] == edge[order][:-1])
    first, second = order[same], order[same + 1]
    a, b = owner[first], owner[second]
    neighbours = np.full(3 * count, -1, dtype=np.int64)
    neighbours[first], neighbours[second] = b, a
    links = coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(count, count))
    number, body = connected_components(links, directed=False)
    balance = np.bincount(edge, weights=np.where(start < stop, 1, -1))
    sound = (np.bincount(edge) == 2) & (balance == 0)
    closed = np.ones(number, dtype=bool)
    closed[body[owner[~sound[edge]]]] = False
    return body.astype(np.int64), closed, neighbours.reshape(-1, 3)


def describe(point: Floats) -> str:
    """A place, for messages."""
    return "(" + ", ".join(f"{value:.6g}" for value in point) + ")"
