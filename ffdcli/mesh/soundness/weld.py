"""Make vertices at one place one vertex: exactly equal ones, or those within a distance.

Only vertices at open edges are looked at: what the file joins already stays as the file has it, so
bodies that touch stay apart.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.edges import EdgeUses, find_edges, open_vertices
from ffdcli.mesh.record import Mesh

# Two roundings of one point differ by up to one step along each axis: for text, where delta is half
# a step, by up to 3.5 delta.
_WELD_REACH = 4.0


def weld_equal(vertices: Floats, corners: Ints, starts: Ints, part: Ints | None = None) -> Ints:
    """Join the vertices at open edges whose coordinates are the same to the last bit.

    Parameters
    ----------
    vertices, corners, starts
        As in `Mesh`.
    part : (V,) int64, optional
        Parts of the file: what can be joined within its part is joined there first.

    Returns
    -------
    (V,) int64
        For each vertex the one that takes its place: itself or an earlier one.
    """
    target = np.arange(len(vertices))
    for apart in ([] if part is None else [part]) + [np.zeros(len(vertices), dtype=np.int64)]:
        mesh = Mesh(vertices, target[corners], starts)
        chosen = open_vertices(find_edges(mesh))
        # -0.0 becomes 0.0: the same place.
        points = vertices[chosen] + 0.0
        keys = np.ascontiguousarray(np.column_stack([points, apart[chosen]]))
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
    """Vertices at open edges that lie within `weld_reach` of an earlier one.

    Neighbours along an edge stay apart: they are the ends of a short edge, not one point twice.

    Returns
    -------
    moved, target : (n,) int64
        Each target stays where it is, so nothing moves further than the reach.
    """
    from scipy.spatial import cKDTree

    chosen = open_vertices(edges)
    none = np.empty(0, dtype=np.int64)
    if not len(chosen):
        return none, none
    tree = cKDTree(mesh.vertices[chosen])
    pairs = chosen[tree.query_pairs(weld_reach(mesh), output_type="ndarray").reshape(-1, 2)]
    pairs.sort(axis=1)
    joined = np.isin(pairs @ [len(mesh.vertices), 1], edges.ends @ [len(mesh.vertices), 1])
    pairs = pairs[~joined]
    target = np.arange(len(mesh.vertices))
    np.minimum.at(target, pairs[:, 1], pairs[:, 0])
    stays = target == np.arange(len(target))
    pairs = pairs[stays[pairs[:, 0]]]
    target = np.arange(len(mesh.vertices))
    np.minimum.at(target, pairs[:, 1], pairs[:, 0])
    moved = np.flatnonzero(target != np.arange(len(target)))
    return moved, target[moved]
