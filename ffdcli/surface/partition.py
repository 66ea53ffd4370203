"""Which planes cut which groups, and the regions that the cuts leave.

A region is a set of coplanar, edge-connected pieces on which the deformed plane is one surface:
inside one lattice box, within one slab of the dominant axis where both slopes differ from 0, and
never across a knot plane where the volume is only C0. Outside all boxes a region is simply planar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import find_twins
from ffdcli.splines.knots import KnotPlanes
from ffdcli.surface.cut import CutRule, Pieces, from_triangles, split
from ffdcli.surface.graph import Graphs
from ffdcli.surface.planes import PlaneGroups
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume

# Zone of what lies in none of the lattice boxes.
OUTSIDE = -1


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
        Row of :class:`Graphs` for each patch: its plane in its own frame.
    zone : (Q,) int64
        The volume in whose box each patch lies, -1 for none.
    low, high : (Q, 3) float64
        Bounding box of each patch's vertices, in its own frame.
    """

    pieces: Pieces
    region: Ints
    patch: Ints
    group: Ints
    zone: Ints
    low: Floats
    high: Floats

    @property
    def inside(self) -> Bools:
        """(Q,) True where the patch lies in a lattice box."""
        return np.asarray(self.zone >= 0)

    @property
    def frame(self) -> Ints:
        """(Q,) the volume whose frame each patch is told in: its own, outside the first one's."""
        return np.maximum(self.zone, 0)

    def in_frame(self, number: int) -> Floats:
        """(V, 3) coordinates of the vertices in the frame of a volume."""
        return self.pieces.vertices[:, 3 * number : 3 * number + 3]


def partition(
    vertices: Floats,
    triangles: Ints,
    groups: PlaneGroups,
    graphs: Graphs,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
    *,
    every_knot: bool,
) -> Partition:
    """Cut the mesh by the sides of all boxes, and inside each by the knot planes a group needs.

    Parameters
    ----------
    vertices : (V, 3 n) float64
        Coordinates in the frames of the n volumes, side by side.
    triangles : (T, 3) int64
    volumes : sequence of Volume
        Their boxes have no inner point in common.
    every_knot : bool
        True cuts every group at every knot plane of all three axes (the paper's own partition);
        False cuts at the dominant axis' knots where both slopes differ from 0, and where the
        volume is C0.
    """
    pieces = from_triangles(vertices, triangles, groups.sides)
    zone = np.full(pieces.count, OUTSIDE)
    for number, volume in enumerate(volumes):
        pieces, zone = _cut_at_box(pieces, zone, number, volume.box, tolerances)
    count = len(groups.normal)
    crossings = []
    for number, volume in enumerate(volumes):
        rows = slice(number * count, (number + 1) * count)
        boxes = np.stack([graphs.low[rows], graphs.high[rows]], axis=1)
        for axis in range(3):
            planes, near = _distinct(volume.knot_planes(axis, boxes))
            needed = _needed(graphs, rows, axis, planes, tolerances, every_knot=every_knot) & near
            crossings.append((number, axis, planes, needed))
            for i, value in enumerate(planes.values):
                wanted = needed[groups.group, i]
                if wanted.any():
                    rule = cut_rule(tolerances, int(planes.continuity[i]))
                    chosen = wanted[pieces.triangle] & (zone == number)
                    pieces, cut = split(pieces, 3 * number + axis, float(value), rule, chosen)
                    zone = np.concatenate([zone, zone[cut]])
    labels = [zone, groups.group[pieces.triangle]]
    for number, axis, planes, needed in crossings:
        low, high = pieces.bounds(3 * number + axis)
        passed = (low + high)[:, None] / 2 > planes.values[None, :]
        below = (passed & needed[labels[1]]).sum(axis=1)
        labels.append(np.where(zone == number, below, 0))
    _, cell = np.unique(np.column_stack(labels), axis=0, return_inverse=True)
    return connect(pieces, groups, zone, cell.reshape(-1), shared=every_knot)


def _needed(
    graphs: Graphs,
    rows: slice,
    axis: int,
    planes: KnotPlanes,
    tolerances: Tolerances,
    *,
    every_knot: bool,
) -> Bools:
    """(G, n) which planes across an axis cut which groups, told in the frame of their volume."""
    slab = (graphs.axes[rows, 0] == axis) & graphs.sloping[rows].all(axis=1)
    needed = slab[:, None] | (planes.continuity == 0)[None, :] | every_knot
    # A group that passes the plane on one side only is not cut, however its noise may lie.
    snap = tolerances.snap(planes.continuity)
    needed &= graphs.low[rows, axis, None] < planes.values - snap
    needed &= graphs.high[rows, axis, None] > planes.values + snap
    return needed


def _distinct(planes: KnotPlanes) -> tuple[KnotPlanes, Bools]:
    """Planes of many groups, each once and rising, and which of them are whose (G, n)."""
    present = ~np.isnan(planes.values)
    values, which = np.unique(planes.values[present], return_inverse=True)
    continuity = np.zeros(len(values), dtype=np.int64)
    continuity[which] = planes.continuity[present]
    owned = np.zeros((len(present), len(values)), dtype=bool)
    owned[np.nonzero(present)[0], which] = True
    return KnotPlanes(values, continuity), owned


def cut_rule(tolerances: Tolerances, continuity: int) -> CutRule:
    """How to cut at a plane across which the volume is C^continuity."""
    order = np.array(continuity)
    reach = float(tolerances.reach(order))
    return CutRule(float(tolerances.snap(order)), tolerances.shortest_edge, reach)


def _cut_at_box(
    pieces: Pieces, zone: Ints, number: int, box: Floats, tolerances: Tolerances
) -> tuple[Pieces, Ints]:
    """Cut at the six sides of one volume's box; say which pieces are inside.

    The borders may join with C0 only, so vertices snap to the sides as they do to such knots. What
    lies in an earlier box stays as it is: two boxes have at most points of their sides in common.
    """
    rule = cut_rule(tolerances, 0)
    columns = range(3 * number, 3 * number + 3)
    for axis, column in enumerate(columns):
        for value in box[:, axis]:
            chosen = zone == OUTSIDE
            for other, along in enumerate(columns):
                low, high = pieces.bounds(along)
                chosen &= low < box[1, other] + rule.snap
                chosen &= high > box[0, other] - rule.snap
            pieces, cut = split(pieces, column, float(value), rule, chosen)
            zone = np.concatenate([zone, zone[cut]])
    within = zone == OUTSIDE
    for axis, column in enumerate(columns):
        low, high = pieces.bounds(column)
        middle = (low + high) / 2
        flat = high - low <= 2 * rule.snap
        # A piece that lies in a side, within snap, is inside: points on the box are.
        slack = np.where(flat, rule.snap, 0.0)
        within &= (middle >= box[0, axis] - slack) & (middle <= box[1, axis] + slack)
    return pieces, np.where(within, number, zone)


def connect(
    pieces: Pieces, groups: PlaneGroups, zone: Ints, cell: Ints, *, shared: bool
) -> Partition:
    """Regions of pieces: those of one cell that share edges.

    Parameters
    ----------
    zone : (N,) int64
        The volume in whose box each piece lies, -1 for none.
    cell : (N,) int64
        Number of each piece's cell; pieces of different cells are never joined.
    shared : bool
        True gives all regions of a cell one patch, False each its own.
    """
    twins = find_twins(pieces.edges, pieces.corners)
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
    frame = np.maximum(zone, 0)
    for column in range(pieces.vertices.shape[1]):
        number, axis = divmod(column, 3)
        mine = np.flatnonzero(frame == number)
        lowest, highest = pieces.bounds(column)
        np.minimum.at(low[:, axis], patch[region[mine]], lowest[mine])
        np.maximum.at(high[:, axis], patch[region[mine]], highest[mine])
    return Partition(
        pieces=pieces,
        region=region,
        patch=patch,
        group=groups.group[pieces.triangle[member]] + frame[member] * len(groups.normal),
        zone=zone[member],
        low=low,
        high=high,
    )
