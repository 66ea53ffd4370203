"""How the polygons use their edges, for all edges at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Ints
from ffdcli.corners import edge_keys, next_corners
from ffdcli.mesh.record import Mesh


@dataclass(frozen=True)
class EdgeUses:
    """The undirected edges of a mesh.

    Parameters
    ----------
    ends : (E, 2) int64
        Vertices of each edge, the lower first.
    uses : (E,) int64
        How many polygon sides run along it.
    forward : (E,) int64
        How many of those run from the lower vertex to the higher.
    edge_of_corner : (C,) int64
        The edge from each polygon corner to the next.
    """

    ends: Ints
    uses: Ints
    forward: Ints
    edge_of_corner: Ints


def find_edges(mesh: Mesh) -> EdgeUses:
    """Collect the edges of all polygons."""
    tails, heads = mesh.corners, mesh.corners[next_corners(mesh.starts)]
    count = len(mesh.vertices)
    keys, edge, uses = np.unique(
        edge_keys(tails, heads, count),
        return_inverse=True,
        return_counts=True,
    )
    forward = np.bincount(edge, weights=tails < heads, minlength=len(keys)).astype(np.int64)
    return EdgeUses(np.column_stack(np.divmod(keys, count)), uses, forward, edge)


def open_vertices(edges: EdgeUses) -> Ints:
    """Vertices at the ends of edges that one polygon alone uses."""
    return np.unique(edges.ends[edges.uses == 1])


def label_bodies(mesh: Mesh, edges: EdgeUses) -> tuple[int, Ints]:
    """Number of edge-connected bodies, and the (P,) body of each polygon."""
    # Polygons and edges are the nodes; sharing an edge is two steps.
    size = mesh.polygon_count + len(edges.ends)
    links = (mesh.polygon_of_corner, mesh.polygon_count + edges.edge_of_corner)
    graph = coo_array((np.ones(len(mesh.corners), dtype=np.int8), links), shape=(size, size))
    count, label = connected_components(graph, directed=False)
    return int(count), label[: mesh.polygon_count].astype(np.int64)
