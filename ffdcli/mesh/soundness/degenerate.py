"""Polygons without area: spikes cut back, needles collapsed, caps taken out."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.corners import next_corners
from ffdcli.mesh.polygons import repeats_a_vertex
from ffdcli.mesh.record import Mesh


def find_degenerate(mesh: Mesh) -> Bools:
    """(P,) polygons thinner than coordinates can tell."""
    points = mesh.vertices[mesh.corners]
    sides = np.linalg.norm(points[next_corners(mesh.starts)] - points, axis=1)
    perimeter = np.add.reduceat(sides, mesh.starts[:-1])
    spokes = points - np.repeat(points[mesh.starts[:-1]], np.diff(mesh.starts), axis=0)
    fans = np.linalg.norm(np.cross(spokes, spokes[next_corners(mesh.starts)]), axis=1)
    # Without sign, so that the two halves of a crossing outline do not cancel.
    area = np.add.reduceat(fans, mesh.starts[:-1]) / 2
    # Coordinates rounded by half a unit in the last place move the area by at most so much.
    rounding = 4 * np.spacing(np.abs(points).max()) * perimeter
    return np.asarray(area <= rounding)


def find_needle_ends(mesh: Mesh, degenerate: Bools, reach: float) -> tuple[Ints, Ints]:
    """The sides, no longer than `reach`, of polygons without area: ends that are one point.

    Returns
    -------
    moved, target : (n,) int64
        Each target is an earlier vertex and stays where it is.
    """
    heads = mesh.corners[next_corners(mesh.starts)]
    sides = np.column_stack([mesh.corners, heads])[degenerate[mesh.polygon_of_corner]]
    sides.sort(axis=1)
    sides = sides[sides[:, 0] < sides[:, 1]]
    length = np.linalg.norm(mesh.vertices[sides[:, 0]] - mesh.vertices[sides[:, 1]], axis=1)
    sides = np.unique(sides[length <= reach], axis=0)
    # Chains are taken up one link at a time.
    sides = sides[~np.isin(sides[:, 0], sides[:, 1])]
    moved, first = np.unique(sides[:, 1], return_index=True)
    return moved, sides[first, 0]


def cut_spikes(mesh: Mesh) -> Mesh:
    """Take out of every outline what it runs along and straight back, and corners met twice."""
    spiked = np.flatnonzero(repeats_a_vertex(mesh.corners, mesh.starts))
    loops = {
        polygon: mesh.starts[polygon]
        + _reduce(mesh.corners[mesh.starts[polygon] : mesh.starts[polygon + 1]].tolist())
        for polygon in spiked.tolist()
    }
    counts = np.diff(mesh.starts)
    if all(len(loop) == counts[polygon] for polygon, loop in loops.items()):
        return mesh
    pieces = np.split(np.arange(len(mesh.corners)), mesh.starts[1:-1])
    for polygon, loop in loops.items():
        pieces[polygon] = loop
    kept = np.flatnonzero([len(piece) > 2 for piece in pieces])
    left = [pieces[n] for n in kept.tolist()]
    starts = np.concatenate([[0], np.cumsum([len(piece) for piece in left])])
    corner = np.concatenate([*left, np.empty(0, dtype=np.int64)])
    return mesh.rebuilt(mesh.vertices, mesh.corners[corner], starts.astype(np.int64), kept, corner)


def _reduce(loop: list[int]) -> Ints:
    """Places in a closed walk that are left without steps straight back.

    Fewer than three where nothing is left.
    """
    walk: list[int] = []
    for place, vertex in enumerate(loop):
        if walk and loop[walk[-1]] == vertex:
            continue
        if len(walk) > 1 and loop[walk[-2]] == vertex:
            walk.pop()
        else:
            walk.append(place)
    # The same where the end meets the beginning.
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
