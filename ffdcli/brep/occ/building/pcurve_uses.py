"""Which edges have pcurves on B-spline surfaces, and which are straight lines between planes."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Brep
from ffdcli.errors import KernelError


class Pairs:
    """Pairs of an edge and a B-spline surface at it, sorted by edge and surface.

    ``edge`` and ``surface`` (n,); ``pcurve`` (n,), its number from 1; ``seam`` (n,), True if a
    second pcurve for the other sense follows; ``ends`` (m, 2, 2) of all pcurves.
    """

    def __init__(self, edge: Ints, surface: Ints, pcurve: Ints, seam: Bools, ends: Floats) -> None:
        self.edge, self.surface, self.pcurve = edge, surface, pcurve
        self.seam, self.ends = seam, ends


class CoedgeUses:
    """Coedges on B-spline surfaces, and straight edges between planes."""

    def __init__(self, brep: Brep) -> None:
        face = brep.face_of_coedge
        plane = np.zeros(brep.surface_count, dtype=bool)
        plane[brep.planes.surfaces] = True
        self.brep, self.face = brep, face
        self.on_plane = plane[brep.face_surface[face]]
        between_planes = np.ones(len(brep.edges), dtype=bool)
        between_planes[brep.coedge_edge[~self.on_plane]] = False
        # (E,) edges that become lines.
        self.straight = np.zeros(len(brep.edges), dtype=bool)
        for batch in brep.curves:
            if batch.degree == 1 and batch.poles.shape[1:] == (2, 3):
                self.straight[batch.edges] = between_planes[batch.edges]

    def pairs(self) -> Pairs:
        """Edges and the B-spline surfaces they border, each with its straight pcurve.

        An edge that borders one surface twice (a slit, or two faces that trim the same surface)
        has one pcurve if both uses agree, otherwise one for each sense, like a seam in OpenCascade.
        """
        brep = self.brep
        used = np.flatnonzero(~self.on_plane)
        surface = brep.face_surface[self.face]
        in_face = brep.coedge_forward ^ brep.face_reversed[self.face]
        # The forward use of a seam comes first.
        order = used[np.lexsort((~in_face[used], surface[used], brep.coedge_edge[used]))]
        edge, surface, ends = brep.coedge_edge[order], surface[order], brep.pcurves[order]
        first = np.ones(len(order), dtype=bool)
        first[1:] = (np.diff(edge) != 0) | (np.diff(surface) != 0)
        starts = np.flatnonzero(first)
        owner = np.cumsum(first) - 1
        uses = np.bincount(owner, minlength=len(starts))
        differs = np.zeros(len(starts), dtype=bool)
        differs[owner[(ends != ends[starts][owner]).any(axis=(1, 2))]] = True
        # The second use, or the only one if there is no second.
        second = starts + (uses > 1)
        opposite = in_face[order[starts]] != in_face[order[second]]
        wrong = np.flatnonzero(differs & ~((uses == 2) & opposite))
        if len(wrong):
            at = wrong[0]
            raise KernelError(
                f"edge {edge[starts[at]]} lies on surface {surface[starts[at]]} {uses[at]} times "
                "with different parameters; a CAD edge can do so twice, once in each sense"
            )
        kept = np.zeros(len(order), dtype=bool)
        kept[starts] = True
        kept[second[differs]] = True
        number = np.cumsum(kept)[starts]
        return Pairs(edge[starts], surface[starts], number, differs, ends[kept])
