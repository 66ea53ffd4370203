"""Closedness and orientation of boundary representations and triangle meshes."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Topology
from ffdcli.graphs import connected_components


class EdgesInUse(Protocol):
    """What tells how loops use edges: :class:`~ffdcli.brep.record.Topology` and its kin."""

    @property
    def edges(self) -> Ints:
        """(E, 2) start and end vertices."""
        ...

    @property
    def coedge_edge(self) -> Ints:
        """(C,) edge of each use."""
        ...

    @property
    def coedge_forward(self) -> Bools:
        """(C,) whether the loop runs the edge from its start to its end."""
        ...


def edge_uses(record: EdgesInUse) -> tuple[Ints, Ints]:
    """Numbers of forward and of backward uses of each edge by loops, (E,) each."""
    count = len(record.edges)
    forward = record.coedge_edge[record.coedge_forward]
    backward = record.coedge_edge[~record.coedge_forward]
    return np.bincount(forward, minlength=count), np.bincount(backward, minlength=count)


def edge_faults(record: EdgesInUse) -> tuple[Bools, Bools]:
    """Masks (E,) of border edges, and of edges that are used wrongly.

    An edge is used wrongly if two loops run it in the same sense (one face is flipped) or if more
    than two use it.
    """
    forward, backward = edge_uses(record)
    used = forward + backward
    # An edge that no face uses is harmless.
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
    """Edge-connected bodies of a triangle mesh, and the neighbours of its triangles.

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
    body = connected_components(count, a, b)
    balance = np.bincount(edge, weights=np.where(start < stop, 1, -1))
    sound = (np.bincount(edge) == 2) & (balance == 0)
    closed = np.ones(int(body.max(initial=-1)) + 1, dtype=bool)
    closed[body[owner[~sound[edge]]]] = False
    return body, closed, neighbours.reshape(-1, 3)


def describe(point: Floats) -> str:
    """Text of a point, for messages."""
    return "(" + ", ".join(f"{value:.6g}" for value in point) + ")"
