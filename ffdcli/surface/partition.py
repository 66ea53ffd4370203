"""The partition of a mesh into regions, each of which becomes one face.

A region is a set of coplanar, edge-connected pieces on which the deformed plane is one surface:
inside one lattice box, within one slab of the dominant axis where both slopes differ from 0, and
never across a knot plane where the volume is only C0. Outside all boxes a region is planar. The
outline of a region passes each vertex once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows
from ffdcli.corners import find_twins
from ffdcli.graphs import connected_components
from ffdcli.splines.knots import KnotPlanes
from ffdcli.surface.cut import CutPlane, CutRule, Pieces, from_triangles, split
from ffdcli.surface.facets import Facets
from ffdcli.surface.plane_graphs import PlaneGraphs
from ffdcli.surface.rectangles import Rectangles, bounding_rectangles
from ffdcli.surface.tolerance import Tolerances
from ffdcli.surface.touches import divide_at_touches

# Zone of pieces that lie in no lattice box.
OUTSIDE = -1


@dataclass(frozen=True)
class Partition:
    """The pieces of a cut mesh, their regions, and the patches (surfaces) of these.

    Parameters
    ----------
    facets : Facets
        What was cut.
    pieces : Pieces
    region : (N,) int64
        Region of each piece.
    patch : (R,) int64
        Patch of each region: that of all regions of one plane outside all boxes or, unless
        ``facets.patches`` is `merged`, in one knot box; otherwise its own.
    group : (Q,) int64
        Plane group of each patch.
    zone : (Q,) int64
        The volume in whose box each patch lies, -1 for none.
    graphs : PlaneGraphs
        The plane (Q,) of each patch in its frame.
    low, high : (Q, 3) float64
        Bounding box of the vertices of each patch in its frame.
    rectangles : Rectangles or None
        Of all patches, where ``facets.patches`` is `paper`.
    """

    facets: Facets
    pieces: Pieces
    region: Ints
    patch: Ints
    group: Ints
    zone: Ints
    graphs: PlaneGraphs
    low: Floats
    high: Floats
    rectangles: Rectangles | None

    @property
    def inside(self) -> Bools:
        """(Q,) True where the patch lies in a lattice box."""
        return np.asarray(self.zone >= 0)

    @property
    def frame_volume(self) -> Ints:
        """(Q,) the volume in whose frame each patch is described; outside all boxes the first."""
        return np.maximum(self.zone, 0)

    def local(self, vertices: Ints, patches: Ints) -> Floats:
        """Coordinates (..., 3) of vertices (...) along the axes ``a, b, c`` of patches (...)."""
        frame = self.frame_volume[patches][..., None]
        return self.pieces.vertices[vertices[..., None], frame, self.graphs.axes[patches]]

    def parameters(self, vertices: Ints, patches: Ints) -> Floats:
        """Surface parameters (m, n, 2) of vertices (m, n) in patches (m,)."""
        if self.rectangles is None:
            return self.local(vertices, patches[:, None])[..., 1:]
        points = self.pieces.vertices[vertices, self.frame_volume[patches][:, None]]
        return self.rectangles.parameters(points, patches)

    def offsets(self, vertices: Ints, parameters: Floats, patches: Ints) -> Floats:
        """Distances (m, n, 3) along u, v, w of vertices (m, n) from their places on the planes.

        On a graph the place is that above the vertex, along the dominant axis.
        """
        frame = self.frame_volume[patches][:, None]
        points = self.pieces.vertices[vertices, frame]
        if self.rectangles is not None:
            return np.abs(points - self.rectangles.points(parameters, patches))
        height = self.graphs.height(patches, parameters[..., 0], parameters[..., 1])
        rise = np.abs(self.local(vertices, patches[:, None])[..., 0] - height)
        along = np.arange(3) == self.graphs.axes[patches, None, :1]
        return np.where(along, rise[..., None], 0.0)


def partition(vertices: Floats, triangles: Ints, facets: Facets) -> Partition:
    """Cut the mesh at the sides of all boxes, and inside each box at knot planes.

    Unless ``facets.patches`` is `merged` at all of them; otherwise only where a cut is needed: at
    the knots of the dominant axis where both slopes differ from 0, and where the volume is C0.

    Parameters
    ----------
    vertices : (V, n, 3) float64
        Coordinates in the frames of the n volumes.
    triangles : (T, 3) int64
    facets : Facets
    """
    groups = facets.groups
    pieces = from_triangles(vertices, triangles, groups.sides)
    zone = np.full(pieces.count, OUTSIDE)
    for number in range(len(facets.volumes)):
        pieces, zone = _cut_at_box(pieces, zone, facets, number)
    crossings = []
    for number, volume in enumerate(facets.volumes):
        boxes = np.stack([facets.graphs.low[number], facets.graphs.high[number]], axis=1)
        for axis in range(3):
            planes, near = _distinct(volume.knot_planes(axis, boxes))
            needed = _needed(facets, number, axis, planes) & near
            crossings.append((number, axis, planes, needed))
            for i, value in enumerate(planes.values):
                wanted = needed[groups.group, i]
                if wanted.any():
                    rule = cut_rule(facets.tolerances, int(planes.continuity[i]))
                    plane = CutPlane(number, axis, float(value), rule)
                    chosen = wanted[pieces.triangle] & (zone == number)
                    pieces, cut = split(pieces, plane, chosen)
                    zone = np.concatenate([zone, zone[cut]])
    labels = [zone, groups.group[pieces.triangle]]
    for number, axis, planes, needed in crossings:
        low, high = pieces.bounds(number, axis)
        passed = (low + high)[:, None] / 2 > planes.values[None, :]
        below = (passed & needed[labels[1]]).sum(axis=1)
        labels.append(np.where(zone == number, below, 0))
    _, cell = distinct_rows(np.column_stack(labels))
    return connect(pieces, facets, zone, cell)


def _needed(facets: Facets, number: int, axis: int, planes: KnotPlanes) -> Bools:
    """(G, p) True where a group has to be cut at a knot plane across an axis of a volume."""
    graphs = facets.graphs
    slab = (graphs.axes[number, :, 0] == axis) & graphs.sloping[number].all(axis=1)
    needed = slab[:, None] | (planes.continuity == 0)[None, :] | facets.by_knot_box
    # A group that lies on one side of the plane, up to noise, is not cut.
    snap = facets.tolerances.snap(planes.continuity)
    needed &= graphs.low[number, :, axis, None] < planes.values - snap
    needed &= graphs.high[number, :, axis, None] > planes.values + snap
    return needed


def _distinct(planes: KnotPlanes) -> tuple[KnotPlanes, Bools]:
    """The distinct knot planes (p,) of all groups, rising, and which group crosses which (G, p)."""
    present = ~np.isnan(planes.values)
    values, which = np.unique(planes.values[present], return_inverse=True)
    continuity = np.zeros(len(values), dtype=np.int64)
    continuity[which] = planes.continuity[present]
    owned = np.zeros((len(present), len(values)), dtype=bool)
    owned[np.nonzero(present)[0], which] = True
    return KnotPlanes(values, continuity), owned


def cut_rule(tolerances: Tolerances, continuity: int) -> CutRule:
    """The rule for vertices near a plane across which the volume is C^continuity."""
    order = np.array(continuity)
    reach = float(tolerances.reach(order))
    return CutRule(float(tolerances.snap(order)), tolerances.shortest_edge, reach)


def _cut_at_box(pieces: Pieces, zone: Ints, facets: Facets, number: int) -> tuple[Pieces, Ints]:
    """Cut at the six sides of one volume's box, and set the zone (N,) of the pieces inside.

    The deformation may join there with C0 only, so vertices snap to the sides as to C0 knots.
    Pieces in an earlier box stay: two boxes have at most points of their sides in common.
    """
    rule, box = cut_rule(facets.tolerances, 0), facets.volumes[number].box
    for axis in range(3):
        for value in box[:, axis]:
            chosen = zone == OUTSIDE
            for other in range(3):
                low, high = pieces.bounds(number, other)
                chosen &= low < box[1, other] + rule.snap
                chosen &= high > box[0, other] - rule.snap
            pieces, cut = split(pieces, CutPlane(number, axis, float(value), rule), chosen)
            zone = np.concatenate([zone, zone[cut]])
    within = zone == OUTSIDE
    for axis in range(3):
        low, high = pieces.bounds(number, axis)
        middle = (low + high) / 2
        flat = high - low <= 2 * rule.snap
        # A piece that lies in a side, within snap, is inside, as points on the box are.
        slack = np.where(flat, rule.snap, 0.0)
        within &= (middle >= box[0, axis] - slack) & (middle <= box[1, axis] + slack)
    return pieces, np.where(within, number, zone)


def connect(pieces: Pieces, facets: Facets, zone: Ints, cell: Ints) -> Partition:
    """Make regions of the pieces of one cell that share edges, and touch themselves nowhere.

    Parameters
    ----------
    pieces : Pieces
    facets : Facets
        Where cut by knot box, all regions of a cell have one patch; otherwise each has its own,
        except outside all boxes.
    zone : (N,) int64
        The volume in whose box each piece lies, -1 for none.
    cell : (N,) int64
        Number of each piece's cell; pieces of different cells are never joined.
    """
    twins = find_twins(pieces.edges, pieces.corners)
    owner = pieces.owner
    left = np.flatnonzero(twins > np.arange(len(twins)))
    first, second = owner[left], owner[twins[left]]
    same = cell[first] == cell[second]
    region = connected_components(pieces.count, first[same], second[same])
    region = divide_at_touches(pieces, twins, region)
    sample = np.zeros(int(region.max(initial=-1)) + 1, dtype=np.int64)
    sample[region] = np.arange(pieces.count)
    # Outside all boxes nothing bends: the parts of a plane there are one surface.
    joint = facets.by_knot_box | (zone[sample] == OUTSIDE)
    key = np.column_stack([joint, np.where(joint, cell[sample], np.arange(len(sample)))])
    _, patch = distinct_rows(key)
    patches = int(patch.max(initial=-1)) + 1
    member = np.zeros(patches, dtype=np.int64)
    member[patch] = sample
    low, high = np.full((patches, 3), np.inf), np.full((patches, 3), -np.inf)
    frame_volume = np.maximum(zone, 0)
    for number in range(len(facets.volumes)):
        mine = np.flatnonzero(frame_volume == number)
        for axis in range(3):
            lowest, highest = pieces.bounds(number, axis)
            np.minimum.at(low[:, axis], patch[region[mine]], lowest[mine])
            np.maximum.at(high[:, axis], patch[region[mine]], highest[mine])
    group = facets.groups.group[pieces.triangle[member]]
    graphs, rectangles = facets.graphs.take((frame_volume[member], group)), None
    if facets.patches == "paper":
        degrees = np.array([volume.degrees for volume in facets.volumes])
        points = pieces.vertices[pieces.corners, frame_volume[owner]]
        rectangles = bounding_rectangles(
            graphs, degrees[frame_volume[member]], points, patch[region[owner]]
        )
    return Partition(
        facets=facets,
        pieces=pieces,
        region=region,
        patch=patch,
        group=group,
        zone=zone[member],
        graphs=graphs,
        low=low,
        high=high,
        rectangles=rectangles,
    )
