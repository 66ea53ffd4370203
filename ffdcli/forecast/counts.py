"""How much a run makes: faces, edges, control points and their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.brep.assemble import straight_edges
from ffdcli.brep.geometry import Geometry
from ffdcli.brep.record import Brep
from ffdcli.surface.affine import find_affine
from ffdcli.volume.protocol import BoxMap, Volume


@dataclass(frozen=True)
class Counts:
    """What a boundary representation consists of.

    Parameters
    ----------
    triangles : float
        Of the mesh.
    faces, patches, edges, coedges : float
    surface_points, curve_points : float
        Control points; those of straight edges are not counted.
    components : int
        Numbers in a control point: 3, or 4 with weights.
    net_points : float
        Control points of the lattices.
    """

    triangles: float
    faces: float
    patches: float
    edges: float
    coedges: float
    surface_points: float
    curve_points: float
    components: int = 3
    net_points: float = 0

    @property
    def numbers(self) -> float:
        """Coordinates and weights of all control points."""
        return self.components * (self.surface_points + self.curve_points)

    def reduced_as(self, exact: Counts, made: Counts) -> Counts:
        """What is left of these where a reduction leaves ``made`` of ``exact``."""
        return replace(
            self,
            surface_points=self.surface_points * made.surface_points / max(exact.surface_points, 1),
            curve_points=self.curve_points * made.curve_points / max(exact.curve_points, 1),
        )


def count_planned(geometry: Geometry, volumes: Sequence[Volume], triangles: int) -> Counts:
    """Count what planned geometry will be with the control nets of volumes.

    Parameters
    ----------
    geometry : Geometry
    volumes : sequence of Volume
    triangles : int
        Of the mesh.
    """
    parts, outlines = geometry.parts, geometry.outlines
    maps = find_affine(volumes, geometry.cells, len(parts.low))
    straight = straight_edges(geometry, maps)
    on_surfaces = on_curves = 0
    for batch in geometry.patches:
        on_surfaces += int(np.prod(batch.pole_counts)) * int((~maps.affine[batch.patches]).sum())
    for curves in geometry.curves:
        on_curves += int(np.prod(curves.pole_counts)) * int((~straight[curves.edges]).sum())
    return Counts(
        triangles=triangles,
        faces=len(parts.patch),
        patches=len(parts.low),
        edges=len(outlines.edges),
        coedges=len(outlines.coedge_edge),
        surface_points=on_surfaces,
        curve_points=on_curves,
        components=4 if any(volume.net_kind.rational for volume in volumes) else 3,
        net_points=_net_points(volumes),
    )


def count_made(brep: Brep, maps: Sequence[BoxMap], triangles: int) -> Counts:
    """Count what a boundary representation is made of.

    Parameters
    ----------
    brep : Brep
    maps : sequence of BoxMap
        That it was deformed by.
    triangles : int
        Of the mesh.
    """
    curved = [batch.poles for batch in brep.curves if batch.poles.shape[1] > 2]
    poles = [batch.poles for batch in brep.surfaces], curved
    on_surfaces, on_curves = (sum(each[..., 0].size for each in some) for some in poles)
    return Counts(
        triangles=triangles,
        faces=brep.face_count,
        patches=brep.surface_count,
        edges=len(brep.edges),
        coedges=len(brep.coedge_edge),
        surface_points=on_surfaces,
        curve_points=on_curves,
        components=max((each.shape[-1] for some in poles for each in some), default=3),
        net_points=_net_points(maps),
    )


def _net_points(maps: Sequence[BoxMap]) -> int:
    return sum(each.net[..., 0].size for each in maps)
