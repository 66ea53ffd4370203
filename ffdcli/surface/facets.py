"""Planar facets of a mesh, and the volumes and tolerances by which they are cut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ffdcli.surface.plane_graphs import PlaneGraphs
from ffdcli.surface.planes import PlaneGroups
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume

Patches = Literal["merged", "bezier", "paper"]


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
    folds : float, model length
        How far needles that face away from their plane reach beyond the outline of their group.
    patches : {"merged", "bezier", "paper"}
        Cut facets where surfaces need it, with one surface each; or at all knot planes, with one
        Bézier surface for all parts of a plane in one knot box (Feng 2002), composed as a graph or,
        as in the paper, interpolated over a rectangle.
    """

    groups: PlaneGroups
    graphs: PlaneGraphs
    volumes: tuple[Volume, ...]
    tolerances: Tolerances
    folds: float
    patches: Patches

    @property
    def by_knot_box(self) -> bool:
        """Whether facets are cut at all knot planes."""
        return self.patches != "merged"
