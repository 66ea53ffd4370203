"""Polygons on the same vertices as others, and those of them that are redundant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.graphs import connected_components
from ffdcli.mesh.edges import find_edges
from ffdcli.mesh.record import Mesh


@dataclass(frozen=True)
class Duplicates:
    """Outline (P,) of each polygon, whatever its sense and first corner, and its sense (P,).

    The sense is equal for two polygons on one outline that face the same way.
    """

    outline: Ints
    forward: Bools

    @property
    def again(self) -> Bools:
        """(P,) polygons with the outline of an earlier one."""
        return _later(self.outline)


def find_duplicates(mesh: Mesh) -> Duplicates:
    """Outlines of all polygons."""
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
    """(P,) duplicates that can be dropped without a gap in the surface.

    Of duplicates that face the same way all but the first are redundant. Of two that face opposite
    ways the later is redundant if they continue a single surface, or are a sheet with both sides;
    both are needed between two bodies that touch.
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
    # Number of twofold outlines, and of other polygons, at each edge.
    folds = np.bincount(edge[leading], minlength=len(edges.ends))
    others = np.bincount(edge[~twofold[polygon] & ~useless[polygon]], minlength=len(edges.ends))
    size = mesh.polygon_count + len(edges.ends)
    patch = connected_components(size, polygon[leading], mesh.polygon_count + edge[leading])
    rim = np.flatnonzero(leading & (folds[edge] == 1))
    # At its rim a patch continues as a single surface, or ends; or else two bodies meet on it.
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
    """(P,) whether an earlier polygon has the same key."""
    later = np.ones(len(key), dtype=bool)
    later[np.unique(key, return_index=True)[1]] = False
    return later
