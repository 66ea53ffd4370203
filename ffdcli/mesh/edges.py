"""Undirected edges of a mesh and the number of polygons on each; edge-connected bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.corners import edge_keys, next_corners
from ffdcli.graphs import connected_components
from ffdcli.mesh.record import Mesh


@dataclass(frozen=True)
class EdgeUses:
    """The undirected edges of a mesh.

    Parameters
    ----------
    ends : (E, 2) int64
        Vertices of each edge, the lower first.
    uses : (E,) int64
        Number of polygon sides along each edge.
    forward : (E,) int64
        How many of these run from the lower vertex to the higher.
    edge_of_corner : (C,) int64
        Edge from each polygon corner to the next.
    """

    ends: Ints
    uses: Ints
    forward: Ints
    edge_of_corner: Ints


def find_edges(mesh: Mesh) -> EdgeUses:
    """The edges of all polygons."""
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
    """(n,) vertices at the ends of edges with only one polygon."""
    return np.unique(edges.ends[edges.uses == 1])


def label_bodies(mesh: Mesh, edges: EdgeUses) -> tuple[int, Ints]:
    """Number of edge-connected bodies, and the (P,) body of each polygon."""
    # Nodes of the graph are polygons and edges: two polygons on one edge are two links apart.
    count = mesh.polygon_count
    edge = count + edges.edge_of_corner
    label = connected_components(count + len(edges.ends), mesh.polygon_of_corner, edge)
    return int(label.max(initial=-1)) + 1, label[:count]
