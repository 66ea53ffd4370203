"""Which planes cut which groups, and the regions that the cuts leave.

A region is a set of coplanar, edge-connected pieces on which the deformed plane is one surface:
inside the lattice box, within one slab of the dominant axis where both slopes differ from 0, and
never across a knot plane where the volume is only C0. Outside the box a region is simply planar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.corners import find_twins, next_corners
from ffdcli.surface.cut import CutRule, Pieces, from_triangles, split
from ffdcli.surface.graph import Graphs
from ffdcli.surface.planes import PlaneGroups
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Partition:
    """Cut pieces and the region of each.

    Parameters
    ----------
    pieces : Pieces
    region : (N,) int64
        Region of each piece.
    patch : (R,) int64
        Surface of each region: its own, or in the paper's partition that of all the regions of
        one plane in one knot box.
    group : (Q,) int64
        Plane group of each patch.
    inside : (Q,) bool
        True where the patch lies in the lattice box.
    low, high : (Q, 3) float64
        Bounding box of each patch's vertices.
    """

    pieces: Pieces
    region: Ints
    patch: Ints
    group: Ints
    inside: Bools
    low: Floats
    high: Floats


def partition(
    vertices: Floats,
    triangles: Ints,
    groups: PlaneGroups,
    graphs: Graphs,
    volume: Volume,
    tolerances: Tolerances,
    *,
    every_knot: bool,
) -> Partition:
    """Cut the mesh by the box sides and by the knot planes each group needs.

    Parameters
    ----------
    vertices : (V, 3) float64, lattice frame
    triangles : (T, 3) int64
    every_knot : bool
        True cuts every group at every knot plane of all three axes (the paper's own partition);
        False cuts at the dominant axis' knots where both slopes differ from 0, and where the
        volume is C0.
    """
    pieces = from_triangles(vertices, triangles)
    pieces, within = _cut_at_box(pieces, volume.box, tolerances)
    planes = [volume.knot_planes(axis, volume.box) for axis in range(3)]
    rows = np.arange(len(graphs.axes))
    slab = np.zeros((len(rows), 3), dtype=bool)
    slab[rows, graphs.axes[:, 0]] = graphs.sloping.all(axis=1)
    needed = [
        np.ones((len(rows), len(p.values)), dtype=bool)
        if every_knot
        else (p.continuity == 0)[None, :] | slab[:, axis, None]
        for axis, p in enumerate(planes)
    ]
    for axis, p in enumerate(planes):
        # A group that passes the plane on one side only is not cut, however its noise may lie.
        snap = tolerances.snap(p.continuity)
        needed[axis] &= groups.low[:, axis, None] < p.values - snap
        needed[axis] &= groups.high[:, axis, None] > p.values + snap
        rules = [cut_rule(tolerances, int(continuity)) for continuity in p.continuity]
        for i, value in enumerate(p.values):
            wanted = needed[axis][groups.group, i]
            if wanted.any():
                chosen = wanted[pieces.triangle] & within
                pieces, cut = split(pieces, axis, float(value), rules[i], chosen)
                within = np.concatenate([within, within[cut]])
    labels = [within.astype(np.int64), groups.group[pieces.triangle]]
    for axis, p in enumerate(planes):
        low, high = pieces.bounds(axis)
        passed = (low + high)[:, None] / 2 > p.values[None, :]
        below = (passed & needed[axis][labels[1]]).sum(axis=1)
        labels.append(np.where(within, below, 0))
    _, cell = np.unique(np.column_stack(labels), axis=0, return_inverse=True)
    return connect(pieces, groups, within, cell.reshape(-1), shared=every_knot)


def cut_rule(tolerances: Tolerances, continuity: int) -> CutRule:
    """How to cut at a plane across which the volume is C^continuity."""
    order = np.array(continuity)
    reach = float(tolerances.reach(order))
    return CutRule(float(tolerances.snap(order)), tolerances.shortest_edge, reach)


def _cut_at_box(pieces: Pieces, box: Floats, tolerances: Tolerances) -> tuple[Pieces, Bools]:
    """Cut at the six sides; say which pieces are inside.

    The borders may join with C0 only, so vertices snap to the sides as they do to such knots.
    """
    epsilon, rule = tolerances.epsilon, cut_rule(tolerances, 0)
    for axis in range(3):
        for value in box[:, axis]:
            chosen = np.ones(pieces.count, dtype=bool)
            for other in range(3):
                low, high = pieces.bounds(other)
                chosen &= (low < box[1, other] + epsilon) & (high > box[0, other] - epsilon)
            pieces, _ = split(pieces, axis, float(value), rule, chosen)
    within = np.ones(pieces.count, dtype=bool)
    for axis in range(3):
        low, high = pieces.bounds(axis)
        middle = (low + high) / 2
        flat = high - low <= 2 * epsilon
        # A piece that lies in a side, within epsilon, is inside: points on the box are.
        slack = np.where(flat, epsilon, 0.0)
        within &= (middle >= box[0, axis] - slack) & (middle <= box[1, axis] + slack)
    return pieces, within


def connect(
    pieces: Pieces, groups: PlaneGroups, within: Bools, cell: Ints, *, shared: bool
) -> Partition:
    """Regions of pieces: those of one cell that share edges.

    Parameters
    ----------
    within : (N,) bool
        Pieces inside the lattice box.
    cell : (N,) int64
        Number of each piece's cell; pieces of different cells are never joined.
    shared : bool
        True gives all regions of a cell one patch, False each its own.
    """
    tails = pieces.corners
    heads = tails[next_corners(pieces.starts)]
    twins = find_twins(tails, heads, len(pieces.vertices))
    owner = pieces.owner
    left = np.flatnonzero(twins > np.arange(len(twins)))
    first, second = owner[left], owner[twins[left]]
    same = cell[first] == cell[second]
    ones = np.ones(int(same.sum()), dtype=np.int8)
    graph = coo_array((ones, (first[same], second[same])), shape=(pieces.count, pieces.count))
    count, label = connected_components(graph, directed=False)
    region = label.astype(np.int64)
    sample = np.zeros(count, dtype=np.int64)
    sample[region] = np.arange(pieces.count)
    patch = cell[sample] if shared else np.arange(count)
    patches = int(patch.max(initial=-1)) + 1
    member = np.zeros(patches, dtype=np.int64)
    member[patch] = sample
    low, high = np.full((patches, 3), np.inf), np.full((patches, 3), -np.inf)
    for axis in range(3):
        lowest, highest = pieces.bounds(axis)
        np.minimum.at(low[:, axis], patch[region], lowest)
        np.maximum.at(high[:, axis], patch[region], highest)
    return Partition(
        pieces=pieces,
        region=region,
        patch=patch,
        group=groups.group[pieces.triangle[member]],
        inside=within[member],
        low=low,
        high=high,
    )
