"""Bounds of the distances between curves, surfaces and the deformed mesh.

They are the distances of vertices from planes and straight edges in the undeformed mesh, times the
largest stretch of the volume there (docs/design.md, "Edges and topology").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.surface.affine import PatchCells
from ffdcli.surface.curves import EdgeBatch
from ffdcli.surface.outlines import Outlines
from ffdcli.surface.partition import Partition
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class GapBounds:
    """Bounds for one control net.

    Parameters
    ----------
    edges : (E,) float64, model length
        Bound of the distance between the curve of each edge and the surfaces beside it.
    deviation : float, model length
        Bound of the distance between the deformed mesh and the B-rep; rounding only, where
        polygons of one plane are exactly coplanar.
    rounding : float, model length
        Bound of the rounding errors of interpolated surfaces; 0 where surfaces are composed.
    """

    edges: Floats
    deviation: float
    rounding: float = 0.0


@dataclass(frozen=True)
class Gaps:
    """Distances in the undeformed mesh from which bounds are computed.

    Parameters
    ----------
    edge, zone, off : (C,) int64, (C,) int64, (C, 3) float64
        Of each coedge: its edge, and the distances of the edge's ends from their places on the
        plane of the face, along the axes of a volume's frame.
    added : (E, n, 3) float64
        Other distances between curve and surfaces, along the axes of the frames of n volumes.
    patch_zone, patch_axis, patch_off : (Q,) int64, (Q,) int64, (Q,) float64
        Largest distance of the mesh's vertices from the plane of each patch, along an axis.
    straightened : float
        Largest distance of removed vertices from straight edges, and of needles from the outlines
        that they are folded over.
    cells : tuple of (m, 3) int64
        The distinct polynomial cells of each volume that hold patches.
    """

    edge: Ints
    zone: Ints
    off: Floats
    added: Floats
    patch_zone: Ints
    patch_axis: Ints
    patch_off: Floats
    straightened: float
    cells: tuple[Ints, ...]

    def bounds(self, volumes: Sequence[Volume]) -> GapBounds:
        """Bounds for volumes with the control nets to apply."""
        slopes = [v.slope_bounds(cells) for v, cells in zip(volumes, self.cells, strict=True)]
        # The last row is that of the outside, zone -1.
        slope = np.stack([*slopes, np.ones(3)])
        gap = np.zeros(len(self.added))
        np.maximum.at(gap, self.edge, (self.off * slope[self.zone]).sum(axis=1))
        gap += np.einsum("ezi,zi->e", self.added, slope[:-1])
        off_planes = (self.patch_off * slope[self.patch_zone, self.patch_axis]).max(initial=0.0)
        off_lines = self.straightened * float(np.linalg.norm(slope, axis=1).max())
        return GapBounds(gap, max(float(off_planes) + off_lines, float(gap.max(initial=0.0))))


def plan_gaps(
    parts: Partition,
    outlines: Outlines,
    cells: Sequence[PatchCells],
    curves: Sequence[EdgeBatch],
    pcurves: Floats,
) -> Gaps:
    """Measure the undeformed distances between curves, surfaces and the mesh.

    Ends of a coedge at distance ``d`` from the plane of its region, along the dominant axis, give
    a gap of up to ``d max |dD/du_a|``. An edge that counts as perpendicular to an axis gives half
    its rise times the slope along that axis. An end that counts as lying on a plane where the
    volume is only C0 (a knot plane, a side of the box) but lies ``d`` beside it gives up to
    ``2 d`` times the slope, since the polynomials of both sides differ by that.

    Parameters
    ----------
    parts : Partition
    outlines : Outlines
    cells : sequence of PatchCells
    curves : sequence of EdgeBatch
    pcurves : (C, 2, 2) float64
        Ends of the coedges in the parameters of their faces.
    """
    vertices, volumes = parts.pieces.vertices, parts.facets.volumes
    patch = parts.patch[outlines.coedge_region]
    zone = parts.zone[patch]
    snap = float(parts.facets.tolerances.snap(np.array(0)))
    added = np.zeros((len(outlines.edges), len(volumes), 3))
    for batch in curves:
        rise = np.ptp(vertices[outlines.edges[batch.edges], batch.zone], axis=1)
        for axis in range(3):
            if axis not in batch.running:
                added[batch.edges, batch.zone, axis] += rise[:, axis] / 2
    for number, volume in enumerate(volumes):
        mine = np.unique(outlines.coedge_edge[zone == number])
        for axis in range(3):
            planes = volume.knot_planes(axis, volume.box[None])
            creases = np.concatenate([planes.values[planes.continuity == 0], volume.box[:, axis]])
            places = vertices[outlines.edges[mine], number, axis]
            beside = np.abs(places[:, :, None] - creases).min(axis=2)
            beside = np.where(beside <= snap, beside, 0.0).max(axis=1)
            added[mine, number, axis] += 2 * beside
    used, none = {each.zone: each.cells for each in cells}, np.zeros((0, 3), dtype=np.int64)
    return Gaps(
        edge=outlines.coedge_edge,
        zone=zone,
        off=parts.offsets(outlines.edges[outlines.coedge_edge], pcurves, patch).max(axis=1),
        added=added,
        patch_zone=parts.zone,
        patch_axis=parts.graphs.axes[:, 0],
        patch_off=parts.graphs.deviation,
        straightened=outlines.straightened + parts.facets.folds,
        cells=tuple(used.get(number, none) for number in range(len(volumes))),
    )
