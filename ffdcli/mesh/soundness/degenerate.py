"""Polygons without area; ends of needles to weld, and spikes of outlines to cut off."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.corners import next_corners
from ffdcli.mesh.polygons import from_first_corners, repeats_a_vertex
from ffdcli.mesh.record import Mesh


def find_degenerate(mesh: Mesh) -> Bools:
    """(P,) polygons whose area is zero to the rounding of their coordinates."""
    points = mesh.vertices[mesh.corners]
    sides = np.linalg.norm(points[next_corners(mesh.starts)] - points, axis=1)
    perimeter = np.add.reduceat(sides, mesh.starts[:-1])
    spokes = from_first_corners(points, mesh.starts)
    fans = np.linalg.norm(np.cross(spokes, spokes[next_corners(mesh.starts)]), axis=1)
    # Unsigned, so that the two halves of a crossing outline do not cancel.
    area = np.add.reduceat(fans, mesh.starts[:-1]) / 2
    # Rounding coordinates by half a unit in the last place changes the area by at most this.
    rounding = 4 * np.spacing(np.abs(points).max()) * perimeter
    return np.asarray(area <= rounding)


def find_needle_ends(mesh: Mesh, degenerate: Bools, reach: float) -> tuple[Ints, Ints]:
    """Vertices of polygons without area to be merged: ends of sides no longer than `reach`.

    Returns
    -------
    moved, target : (n,) int64
        Each target is an earlier vertex, and is not itself moved.
    """
    heads = mesh.corners[next_corners(mesh.starts)]
    sides = np.column_stack([mesh.corners, heads])[degenerate[mesh.polygon_of_corner]]
    sides.sort(axis=1)
    sides = sides[sides[:, 0] < sides[:, 1]]
    length = np.linalg.norm(mesh.vertices[sides[:, 0]] - mesh.vertices[sides[:, 1]], axis=1)
    sides = np.unique(sides[length <= reach], axis=0)
    # A chain is merged one link at a time: repair runs in rounds.
    sides = sides[~np.isin(sides[:, 0], sides[:, 1])]
    moved, first = np.unique(sides[:, 1], return_index=True)
    return moved, sides[first, 0]


def cut_spikes(mesh: Mesh) -> Mesh:
    """The mesh without steps forth and straight back in outlines, and without repeated corners."""
    kept = np.ones(len(mesh.corners), dtype=bool)
    for polygon in np.flatnonzero(repeats_a_vertex(mesh.corners, mesh.starts)).tolist():
        first, last = mesh.starts[polygon : polygon + 2]
        kept[first:last] = False
        kept[first + _reduce(mesh.loop(polygon).tolist())] = True
    return mesh if kept.all() else mesh.with_corners(kept)


def _reduce(loop: list[int]) -> Ints:
    """Positions in a closed walk that remain without steps forth and straight back.

    Fewer than three if nothing remains.
    """
    walk: list[int] = []
    for place, vertex in enumerate(loop):
        if walk and loop[walk[-1]] == vertex:
            continue
        if len(walk) > 1 and loop[walk[-2]] == vertex:
            walk.pop()
        else:
            walk.append(place)
    # The same across the end of the walk.
    while len(walk) > 1:
        if loop[walk[0]] == loop[walk[-1]]:
            walk.pop()
        elif len(walk) > 2 and loop[walk[-2]] == loop[walk[0]]:
            walk = walk[:-2]
        elif len(walk) > 2 and loop[walk[1]] == loop[walk[-1]]:
            walk = walk[1:]
        else:
            break
    return np.array(walk, dtype=np.int64)
