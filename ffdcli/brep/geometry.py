"""All that the mesh and the knots determine of a B-rep, whatever the control net."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.shells import Shells
from ffdcli.surface.curves import CurveBatch, plan_curves
from ffdcli.surface.flat import PatchCells, plan_cells
from ffdcli.surface.gaps import Gaps, plan_gaps
from ffdcli.surface.graph import Graphs
from ffdcli.surface.outlines import Outlines
from ffdcli.surface.partition import OUTSIDE, Partition
from ffdcli.surface.patches import PatchBatch
from ffdcli.surface.tolerance import Tolerances
from ffdcli.surface.vertices import Vertices, plan_vertices
from ffdcli.threads import in_threads
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class Geometry:
    """Topology in integers, and what is applied to control nets.

    Parameters
    ----------
    parts : Partition
    graphs : Graphs
    outlines : Outlines
    shells : Shells
    vertices : Vertices
    patches : tuple of PatchBatch
        In lattice boxes.
    curves : tuple of CurveBatch
        In lattice boxes.
    cells : tuple of PatchCells
    gaps : Gaps
    pcurves : (C, 2, 2) float64
        Surface parameters ``(u_b, u_c)`` at the start and end of each coedge's edge.
    """

    parts: Partition
    graphs: Graphs
    outlines: Outlines
    shells: Shells
    vertices: Vertices
    patches: tuple[PatchBatch, ...]
    curves: tuple[CurveBatch, ...]
    cells: tuple[PatchCells, ...]
    gaps: Gaps
    pcurves: Floats

    def written_out(self) -> Geometry:
        """The same with all control points and vertices written out as sums of the net's.

        Only of volumes that are tensor products; the others stay as they are.
        """
        jobs: list[Callable[[], Any]] = [
            *(batch.written_out for batch in self.patches),
            *(batch.written_out for batch in self.curves),
        ]
        done, count = in_threads(jobs), len(self.patches)
        return replace(
            self,
            vertices=self.vertices.written_out(),
            patches=tuple(done[:count]),
            curves=tuple(done[count:]),
        )

    @property
    def written_bytes(self) -> int:
        """What is written out takes in memory."""
        sums = [
            *(batch.sums for batch in self.patches),
            *(batch.sums for batch in self.curves),
            *(batch.sums for batch in self.vertices.batches),
        ]
        return sum(each.bytes for each in sums if each is not None)


def plan_geometry(
    parts: Partition,
    graphs: Graphs,
    outlines: Outlines,
    patches: tuple[PatchBatch, ...],
    shells: Shells,
    model_vertices: Floats,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
) -> Geometry:
    """Prepare what is left: vertices, curves, cells, gaps and pcurves.

    Parameters
    ----------
    parts, graphs, outlines, patches, shells, volumes, tolerances
        As planned.
    model_vertices : (n, 3) float64, model length
        The mesh's own.
    """
    beside = parts.zone[parts.patch[outlines.edge_regions]]
    zone = np.where(outlines.edge_regions >= 0, beside, OUTSIDE).max(axis=1)
    curves = plan_curves(parts.pieces.vertices, outlines.edges, zone, volumes, tolerances)
    cells = plan_cells(volumes, patches, parts)
    pcurves = _pcurves(parts, graphs, outlines, tolerances.epsilon)
    gaps = plan_gaps(parts, graphs, outlines, cells, curves, pcurves, volumes, tolerances)
    return Geometry(
        parts=parts,
        graphs=graphs,
        outlines=outlines,
        shells=shells,
        vertices=plan_vertices(outlines.edges, parts, model_vertices, volumes),
        patches=patches,
        curves=curves,
        cells=cells,
        gaps=gaps,
        pcurves=pcurves,
    )


def _pcurves(parts: Partition, graphs: Graphs, outlines: Outlines, epsilon: float) -> Floats:
    """Where an edge stands still along an axis its curve lies in the middle, and so do these.

    Kernels stumble over pcurves that are all but parallel to a side of the surface.
    """
    ends = parts.pieces.vertices[outlines.edges[outlines.coedge_edge]]
    patch = parts.patch[outlines.coedge_region]
    columns = graphs.axes[parts.group[patch], 1:] + 3 * parts.frame[patch, None]
    at = np.take_along_axis(ends, columns[:, None, :], axis=2)
    still = np.abs(at[:, 1] - at[:, 0]) <= epsilon
    still &= ~still.all(axis=1, keepdims=True)
    return np.where(still[:, None], at.mean(axis=1, keepdims=True), at)
