"""The geometry of a B-rep as functions of control nets, planned from the mesh and the knots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.shells import Shells
from ffdcli.corners import next_corners
from ffdcli.segments import crossing_points
from ffdcli.surface.affine import PatchCells, plan_cells
from ffdcli.surface.curves import EdgeBatch, plan_curves
from ffdcli.surface.gaps import GapBounds, Gaps, plan_gaps
from ffdcli.surface.outlines import Outlines
from ffdcli.surface.partition import OUTSIDE, Partition
from ffdcli.surface.spline_batch import SurfaceBatch
from ffdcli.surface.vertices import Vertices, plan_vertices
from ffdcli.threads import in_threads
from ffdcli.volume.protocol import Volume

# Pcurves may cross so many epsilon from a corner, as far as its tolerance reaches.
_CORNER = 4.0


@dataclass(frozen=True)
class Geometry:
    """Topology in integers, and batches that turn control nets into geometry.

    Parameters
    ----------
    parts : Partition
    outlines : Outlines
    shells : Shells
    vertices : Vertices
    patches : tuple of SurfaceBatch
        In lattice boxes.
    curves : tuple of EdgeBatch
        In lattice boxes.
    cells : tuple of PatchCells
    gaps : Gaps
    pcurves : (C, 2, 2) float64
        Surface parameters at the start and end of the edge of each coedge.
    """

    parts: Partition
    outlines: Outlines
    shells: Shells
    vertices: Vertices
    patches: tuple[SurfaceBatch, ...]
    curves: tuple[EdgeBatch, ...]
    cells: tuple[PatchCells, ...]
    gaps: Gaps
    pcurves: Floats

    def with_matrices(self) -> Geometry:
        """The geometry with matrices from control nets to all control points and vertices.

        Only tensor-product volumes have them.
        """
        jobs: list[Callable[[], Any]] = [
            *(batch.with_matrices for batch in self.patches),
            *(batch.with_matrices for batch in self.curves),
        ]
        done, count = in_threads(jobs), len(self.patches)
        return replace(
            self,
            vertices=self.vertices.with_matrices(),
            patches=tuple(done[:count]),
            curves=tuple(done[count:]),
        )

    def bounds(self, volumes: Sequence[Volume]) -> GapBounds:
        """Bounds for volumes with the control nets to apply."""
        found = self.gaps.bounds(volumes)
        rounding = np.zeros(len(self.parts.group))
        for batch in self.patches:
            rounding[batch.patches] = batch.rounding(volumes[batch.zone])
        edge = self.outlines.coedge_edge
        beside = rounding[self.parts.patch[self.outlines.coedge_region]]
        edges = found.edges.copy()
        np.maximum.at(edges, edge, found.edges[edge] + beside)
        return replace(found, edges=edges, rounding=float(rounding.max(initial=0.0)))

    @property
    def matrix_bytes(self) -> int:
        """Memory that the matrices take."""
        sums = [
            *(batch.sums for batch in self.patches),
            *(batch.sums for batch in self.curves),
            *(batch.sums for batch in self.vertices.batches),
        ]
        return sum(each.bytes for each in sums if each is not None)


def plan_geometry(
    parts: Partition,
    outlines: Outlines,
    patches: tuple[SurfaceBatch, ...],
    shells: Shells,
    model_vertices: Floats,
) -> Geometry:
    """Plan vertices, curves, cells, gaps and pcurves, which complete the geometry.

    Parameters
    ----------
    parts : Partition
    outlines : Outlines
    patches : tuple of SurfaceBatch
    shells : Shells
    model_vertices : (n, 3) float64, model length
        Vertices of the mesh.
    """
    volumes, tolerances = parts.facets.volumes, parts.facets.tolerances
    beside = parts.zone[parts.patch[outlines.edge_regions]]
    zone = np.where(outlines.edge_regions >= 0, beside, OUTSIDE).max(axis=1)
    curves = plan_curves(parts.pieces.vertices, outlines.edges, zone, volumes, tolerances)
    cells = plan_cells(patches, parts)
    pcurves = _pcurves(parts, outlines)
    gaps = plan_gaps(parts, outlines, cells, curves, pcurves)
    return Geometry(
        parts=parts,
        outlines=outlines,
        shells=shells,
        vertices=plan_vertices(outlines.edges, parts, model_vertices),
        patches=patches,
        curves=curves,
        cells=cells,
        gaps=gaps,
        pcurves=pcurves,
    )


def _pcurves(parts: Partition, outlines: Outlines) -> Floats:
    """Straight parameter curves of all coedges, (C, 2, 2).

    A pcurve whose ends differ by less than epsilon along an axis is made an iso-line, as the curve
    is: CAD kernels fail on pcurves that are almost parallel to a side of the surface. Where that
    would make the outline of a needle cross itself, far from a corner, it stays as it is.
    """
    patch = parts.patch[outlines.coedge_region]
    at = parts.parameters(outlines.edges[outlines.coedge_edge], patch)
    epsilon = parts.facets.tolerances.epsilon
    level = np.abs(at[:, 1] - at[:, 0]) <= epsilon
    level &= ~level.all(axis=1, keepdims=True)
    found = np.where(level[:, None], at.mean(axis=1, keepdims=True), at)
    following = next_corners(outlines.loop_coedges)
    forward = outlines.coedge_forward[:, None, None]
    (a, b), true = (np.where(forward, each, each[:, ::-1]).swapaxes(0, 1) for each in (found, at))
    meeting = crossing_points(a, b, a[following], b[following])
    far = np.linalg.norm(meeting - true[1], axis=1) > _CORNER * epsilon
    kept = np.concatenate([np.flatnonzero(far), following[far]])
    found[kept] = at[kept]
    return found
