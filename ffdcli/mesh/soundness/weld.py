"""Vertices at one place to be welded: identical ones, or those within a distance.

Only vertices at open edges are welded. Bodies that touch but are closed therefore stay separate.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.edges import EdgeUses, find_edges, open_vertices
from ffdcli.mesh.record import Mesh

# Two roundings of one point differ by up to one step along each axis. For text, where delta is half
# a step, that is 3.5 delta.
_WELD_REACH = 4.0


def weld_equal(vertices: Floats, corners: Ints, starts: Ints, part: Ints | None = None) -> Ints:
    """Weld the vertices at open edges whose coordinates are identical.

    Parameters
    ----------
    part : (V,) int64, optional
        Part of the file of each vertex: vertices are welded within parts first.

    Returns
    -------
    (V,) int64
        Vertex that replaces each vertex: itself or an earlier one.
    """
    target = np.arange(len(vertices))
    for label in ([] if part is None else [part]) + [np.zeros(len(vertices), dtype=np.int64)]:
        mesh = Mesh(vertices, target[corners], starts)
        chosen = open_vertices(find_edges(mesh))
        # -0.0 becomes 0.0.
        points = vertices[chosen] + 0.0
        keys = np.ascontiguousarray(np.column_stack([points, label[chosen]]))
        _, first, place = np.unique(
            keys.view([("", np.void, 32)]).ravel(), return_index=True, return_inverse=True
        )
        step = np.arange(len(vertices))
        step[chosen] = chosen[first[place]]
        target = step[target]
    return target


def weld_reach(mesh: Mesh) -> float:
    """Distance, model length, within which two vertices may be roundings of one point."""
    return _WELD_REACH * mesh.delta


def find_near(mesh: Mesh, edges: EdgeUses) -> tuple[Ints, Ints]:
    """Vertices at open edges within `weld_reach` of an earlier one.

    Neighbours along an edge are left: they are the ends of a short edge, not roundings of one
    point.

    Returns
    -------
    moved, target : (n,) int64
        No target is moved itself, so no vertex moves further than the reach.
    """
    from scipy.spatial import cKDTree

    chosen = open_vertices(edges)
    none = np.empty(0, dtype=np.int64)
    if not len(chosen):
        return none, none
    tree = cKDTree(mesh.vertices[chosen])
    pairs = chosen[tree.query_pairs(weld_reach(mesh), output_type="ndarray").reshape(-1, 2)]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    joined = np.isin(pairs @ [len(mesh.vertices), 1], edges.ends @ [len(mesh.vertices), 1])
    pairs = pairs[~joined]
    # A vertex with an earlier one in reach is no target.
    pairs = pairs[~np.isin(pairs[:, 0], pairs[:, 1])]
    moved, first = np.unique(pairs[:, 1], return_index=True)
    return moved, pairs[first, 0]
