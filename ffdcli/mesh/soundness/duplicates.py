"""Polygons on the same vertices as others, and which of them a surface has no use for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Bools, Ints
from ffdcli.mesh.edges import find_edges
from ffdcli.mesh.record import Mesh


@dataclass(frozen=True)
class Duplicates:
    """Which polygons have the same outline.

    Parameters
    ----------
    outline : (P,) int64
        Number of each polygon's outline, whichever way round and wherever it begins.
    forward : (P,) bool
        Which way round: of two on one outline the same, if they face the same way.
    """

    outline: Ints
    forward: Bools

    @property
    def again(self) -> Bools:
        """(P,) polygons whose outline an earlier one has."""
        return _later(self.outline)


def find_duplicates(mesh: Mesh) -> Duplicates:
    """Compare the outlines of all polygons."""
    counts = np.diff(mesh.starts)
    outline = np.empty(mesh.polygon_count, dtype=np.int64)
    forward = np.ones(mesh.polygon_count, dtype=bool)
    number = 0
    for count in np.unique(counts).tolist():
        polygon: Ints = np.flatnonzero(counts == count)
        loops = mesh.corners[mesh.starts[polygon][:, None] + np.arange(count)]
        begin = np.argmin(loops, axis=1)[:, None]
        loops = np.take_along_axis(loops, (begin + np.arange(count)) % count, axis=1)
        ahead = loops[:, 1] <= loops[:, -1]
        loops[~ahead, 1:] = loops[~ahead, :0:-1]
        _, same = np.unique(loops, axis=0, return_inverse=True)
        outline[polygon] = number + same.ravel()
        forward[polygon] = ahead
        number += int(same.max()) + 1
    return Duplicates(outline, forward)


def find_redundant(mesh: Mesh) -> Bools:
    """(P,) copies that can go without a gap in the surface.

    Of copies that face one way all but the first. Of two that face opposite ways, where they go on
    one surface or stand alone (a sheet with both sides), the later; where bodies stand on either
    side of them, they are both needed.
    """
    copies = find_duplicates(mesh)
    useless = _later(2 * copies.outline + copies.forward)
    twofold = (np.bincount(copies.outline[~useless]) == 2)[copies.outline]
    if not twofold.any():
        return useless
    edges = find_edges(mesh)
    polygon = mesh.polygon_of_corner
    leading = (twofold & ~copies.again)[polygon]
    edge = edges.edge_of_corner
    # How many twofold outlines, and how many other polygons, there are at each edge.
    folds = np.bincount(edge[leading], minlength=len(edges.ends))
    others = np.bincount(edge[~twofold[polygon] & ~useless[polygon]], minlength=len(edges.ends))
    size = mesh.polygon_count + len(edges.ends)
    links = (polygon[leading], mesh.polygon_count + edge[leading])
    graph = coo_array((np.ones(len(links[0]), dtype=np.int8), links), shape=(size, size))
    patch = connected_components(graph, directed=False)[1]
    rim = np.flatnonzero(leading & (folds[edge] == 1))
    # A patch goes on from its rim singly, or ends there; or two bodies meet on it.
    alone, even = (
        np.bincount(patch[polygon[rim]], weights=kind, minlength=int(patch.max()) + 1)
        for kind in (others[edge[rim]] == 0, others[edge[rim]] % 2 == 0)
    )
    rims = np.bincount(patch[polygon[rim]], minlength=len(even))
    single = (even == 0) | (alone == rims)
    outline_patch = np.zeros(int(copies.outline.max()) + 1, dtype=np.int64)
    first = twofold & ~copies.again
    outline_patch[copies.outline[first]] = patch[: mesh.polygon_count][first]
    later = twofold & copies.again
    return np.asarray(useless | (later & single[outline_patch[copies.outline]]))


def _later(key: Ints) -> Bools:
    """(P,) whether an earlier one has the same key."""
    later = np.ones(len(key), dtype=bool)
    later[np.unique(key, return_index=True)[1]] = False
    return later
