"""T-junctions: vertices at open edges that lie within another open edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Ints, run_starts
from ffdcli.corners import next_corners
from ffdcli.mesh.edges import EdgeUses, open_vertices
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.weld import weld_reach


def find_t_junctions(mesh: Mesh, edges: EdgeUses) -> tuple[Ints, Ints]:
    """Vertices at open edges within the weld reach of the inner part of another open edge.

    Returns
    -------
    corner, vertex : (n,) int64
        Corner at which the open edge begins, and vertex on it, in their order round the polygons.
    """
    from scipy.spatial import cKDTree

    corner = np.flatnonzero(edges.uses[edges.edge_of_corner] == 1)
    if not len(corner):
        return corner, corner
    reach = weld_reach(mesh)
    start = mesh.vertices[mesh.corners[corner]]
    side = mesh.vertices[mesh.corners[next_corners(mesh.starts)[corner]]] - start
    length = np.linalg.norm(side, axis=1)
    chosen = open_vertices(edges)
    near = cKDTree(mesh.vertices[chosen]).query_ball_point(start + side / 2, length / 2 + reach)
    edge = np.repeat(np.arange(len(corner)), [len(each) for each in near])
    vertex = chosen[np.concatenate(near).astype(np.int64)]
    off = mesh.vertices[vertex] - start[edge]
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = side / length[:, None]
    along = np.einsum("ij,ij->i", off, unit[edge])
    off -= along[:, None] * unit[edge]
    within = (along > reach) & (along < length[edge] - reach)
    within &= np.linalg.norm(off, axis=1) <= reach
    # A corner of the same polygon on the edge is a needle, not a T-junction.
    count = len(mesh.vertices)
    own = mesh.polygon_of_corner * count + mesh.corners
    within &= ~np.isin(mesh.polygon_of_corner[corner[edge]] * count + vertex, own)
    edge, vertex, along = edge[within], vertex[within], along[within]
    order = np.lexsort([along, edge])
    return corner[edge[order]], vertex[order]


def insert_vertices(mesh: Mesh, corner: Ints, vertex: Ints) -> Mesh:
    """The mesh with vertices inserted after corners, in the order of `find_t_junctions`."""
    added = np.bincount(mesh.polygon_of_corner[corner], minlength=mesh.polygon_count)
    here = np.arange(len(mesh.corners))
    grown = mesh.rebuilt(
        mesh.vertices,
        np.insert(mesh.corners, corner + 1, vertex),
        mesh.starts + run_starts(added),
        np.arange(mesh.polygon_count),
        np.insert(here, corner + 1, corner),
    )
    if mesh.uv is None or grown.uv is None:
        return grown
    # Texture coordinates are linear along the edge.
    ahead = next_corners(mesh.starts)[corner]
    start = mesh.vertices[mesh.corners[corner]]
    side = mesh.vertices[mesh.corners[ahead]] - start
    share = np.einsum("ij,ij->i", mesh.vertices[vertex] - start, side)
    share /= np.einsum("ij,ij->i", side, side)
    uv = grown.uv.copy()
    uv[corner + 1 + np.arange(len(corner))] = mesh.uv[corner] + share[:, None] * (
        mesh.uv[ahead] - mesh.uv[corner]
    )
    return replace(grown, uv=uv)
