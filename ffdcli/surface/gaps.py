"""How far the B-rep is off the deformed mesh at most, where the mesh is not flat or straight.

It is what vertices lie off planes and edges, which the mesh determines, times the largest stretch
of the volume there (design, section 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.surface.curves import CurveBatch
from ffdcli.surface.flat import PatchCells
from ffdcli.surface.graph import Graphs
from ffdcli.surface.outlines import Outlines
from ffdcli.surface.partition import Partition
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class GapBounds:
    """Bounds for one control net.

    Parameters
    ----------
    edges : (E,) float64, model length
        Of the distance between each edge's curve and the surfaces beside it.
    deviation : float, model length
        Of the distance of the deformed mesh from the B-rep; nothing but rounding where the mesh's
        coplanar polygons are coplanar.
    """

    edges: Floats
    deviation: float


@dataclass(frozen=True)
class Gaps:
    """Distances in the undeformed mesh that bounds are made of.

    Parameters
    ----------
    edge, zone, axis, off : (C,) int64, (C,) int64, (C,) int64, (C,) float64
        Of each coedge: its edge, and how far the edge's ends lie off the face's plane along an
        axis of a volume's frame.
    added : (E, n, 3) float64
        What else lets curve and surfaces part, along the axes of the n volumes' frames.
    patch_zone, patch_axis, patch_off : (Q,) int64, (Q,) int64, (Q,) float64
        How far the mesh's vertices lie off the plane of each patch.
    straightened : float
        How far removed vertices lay off straight edges.
    cells : tuple of (m, 3) int64
        The distinct polynomial cells of each volume that hold patches.
    """

    edge: Ints
    zone: Ints
    axis: Ints
    off: Floats
    added: Floats
    patch_zone: Ints
    patch_axis: Ints
    patch_off: Floats
    straightened: float
    cells: tuple[Ints, ...]

    def bounds(self, volumes: Sequence[Volume]) -> GapBounds:
        """What the distances come to under volumes with the control nets to apply."""
        slopes = [v.slope_bounds(cells) for v, cells in zip(volumes, self.cells, strict=True)]
        # The last row is that of the outside, zone -1.
        slope = np.stack([*slopes, np.ones(3)])
        gap = np.zeros(len(self.added))
        np.maximum.at(gap, self.edge, self.off * slope[self.zone, self.axis])
        gap += np.einsum("ezi,zi->e", self.added, slope[:-1])
        off_planes = (self.patch_off * slope[self.patch_zone, self.patch_axis]).max(initial=0.0)
        off_lines = self.straightened * float(np.linalg.norm(slope, axis=1).max())
        return GapBounds(gap, max(float(off_planes), off_lines, float(gap.max(initial=0.0))))


def plan_gaps(
    parts: Partition,
    graphs: Graphs,
    outlines: Outlines,
    cells: Sequence[PatchCells],
    curves: Sequence[CurveBatch],
    pcurves: Floats,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
) -> Gaps:
    """Measure what parts curves from surfaces, and surfaces from the mesh.

    Where a coedge's ends lie off its region's plane by ``d`` along the dominant axis the two
    differ by up to ``d max |dD/du_a|``; where an edge counts as standing still along an axis, by
    half its rise times the slope along that axis. Where an end counts as lying on a plane across
    which the volume is only C0, a knot plane or a side of the box, and lies ``d`` beside it, the
    polynomials of its two sides part by up to twice ``d`` times the slope.

    Parameters
    ----------
    parts, graphs, outlines, cells, curves, volumes
        As planned.
    pcurves : (C, 2, 2) float64
        Ends of the coedges in their faces.
    tolerances : Tolerances
        An end within ``snap`` of a plane counts as lying on it.
    """
    patch = parts.patch[outlines.coedge_region]
    group, zone = parts.group[patch], parts.zone[patch]
    ends = parts.pieces.vertices[outlines.edges[outlines.coedge_edge]]
    axes = graphs.axes[group]
    column = axes[:, 0] + 3 * parts.frame[patch]
    place = np.take_along_axis(ends, column[:, None, None], axis=2)[:, :, 0]
    height = graphs.height(group, pcurves[:, :, 0], pcurves[:, :, 1])
    snap = float(tolerances.snap(np.array(0)))
    added = np.zeros((len(outlines.edges), len(volumes), 3))
    for batch in curves:
        rise = np.ptp(parts.in_frame(batch.zone)[outlines.edges[batch.edges]], axis=1)
        for axis in range(3):
            if axis not in batch.running:
                added[batch.edges, batch.zone, axis] += rise[:, axis] / 2
    for number, volume in enumerate(volumes):
        mine = np.unique(outlines.coedge_edge[zone == number])
        for axis in range(3):
            planes = volume.knot_planes(axis, volume.box[None])
            creases = np.concatenate([planes.values[planes.continuity == 0], volume.box[:, axis]])
            places = parts.in_frame(number)[outlines.edges[mine], axis]
            beside = np.abs(places[:, :, None] - creases).min(axis=2)
            beside = np.where(beside <= snap, beside, 0.0).max(axis=1)
            added[mine, number, axis] += 2 * beside
    used, none = {each.zone: each.cells for each in cells}, np.zeros((0, 3), dtype=np.int64)
    return Gaps(
        edge=outlines.coedge_edge,
        zone=zone,
        axis=axes[:, 0],
        off=np.abs(place - height).max(axis=1),
        added=added,
        patch_zone=parts.zone,
        patch_axis=graphs.axes[parts.group, 0],
        patch_off=graphs.deviation[parts.group],
        straightened=outlines.straightened,
        cells=tuple(used.get(number, none) for number in range(len(volumes))),
    )
