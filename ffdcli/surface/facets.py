"""Planar facets of a mesh, and the volumes and tolerances by which they are cut."""

from __future__ import annotations

from dataclasses import dataclass

from ffdcli.surface.plane_graphs import PlaneGraphs
from ffdcli.surface.planes import PlaneGroups
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class Facets:
    """Facets of a mesh before they are cut.

    Parameters
    ----------
    groups : PlaneGroups
        Coplanar triangles, in the frame of the first volume.
    graphs : PlaneGraphs
        Their planes in the frames of all volumes, with leading axes (n, G).
    volumes : tuple of Volume
        Their boxes have no inner point in common.
    tolerances : Tolerances
    bezier : bool
        Cut all facets at all knot planes, with one Bézier surface for all parts of a plane in one
        knot box, as in Feng 2002. Otherwise cut where surfaces need it, with one surface each.
    """

    groups: PlaneGroups
    graphs: PlaneGraphs
    volumes: tuple[Volume, ...]
    tolerances: Tolerances
    bezier: bool
