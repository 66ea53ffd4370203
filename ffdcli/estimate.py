"""Estimate the counts, file size and time of a run from its plan alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.brep.assemble import straight_edges
from ffdcli.surface.affine import find_affine

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.pipeline import Plan

# Each per control point of surfaces and curves, per use of an edge by a face, and per face; least
# squares over results of 60 to 2,500 faces, plane and curved, of degree 1 to 9.
_BYTES = {
    "STEP": (114.0, 748.0, 492.0),
    "IGES": (238.0, 871.0, 0.0),
    "BREP": (66.0, 135.0, 0.0),
}
_WRITE_SECONDS = {
    "STEP": (6.1e-6, 36e-6, 775e-6),
    "IGES": (8.4e-6, 7e-6, 482e-6),
    "BREP": (3.6e-6, 32e-6, 38e-6),
}
_SHAPE_SECONDS = (0.7e-6, 23e-6, 0.0)
_CHECK_SECONDS = (2.2e-6, 110e-6, 0.0)
# To start, and to load OpenCascade.
_START_SECONDS = 2.0
# A weight beside each control point.
_WEIGHT_SHARE = 0.2


@dataclass(frozen=True)
class Estimate:
    """Exact counts of what a run will make, and its approximate size and time.

    Parameters
    ----------
    faces, patches, edges, control_points : int
        As in the report of the run.
    bytes : int
        Within a third of the file's size.
    seconds : float
        Within a factor of three on an idle desktop machine of 2023.
    """

    faces: int
    patches: int
    edges: int
    control_points: int
    bytes: int
    seconds: float


def estimate(plan: Plan, lattice: Lattice, *, kind: str = "STEP", check: bool = True) -> Estimate:
    """Estimate the run of a lattice on a planned mesh.

    Parameters
    ----------
    plan : Plan
    lattice : Lattice
        With the knots of the plan.
    kind : {"STEP", "IGES", "BREP"}
    check : bool
        Whether the run would check its result.
    """
    fitted = plan.fit(lattice)
    volumes = lattice.volumes if fitted is None else fitted.lattice.volumes
    geometry = plan.geometry
    parts, outlines = geometry.parts, geometry.outlines
    maps = find_affine(volumes, geometry.cells, len(parts.low))
    affine, straight = maps.affine, straight_edges(geometry, maps)
    on_surfaces = on_curves = 0
    for batch in geometry.patches:
        on_surfaces += int(np.prod(batch.pole_counts)) * int((~affine[batch.patches]).sum())
    for curves in geometry.curves:
        on_curves += int(np.prod(curves.pole_counts)) * int((~straight[curves.edges]).sum())
    rational = any(volume.net_kind.rational for volume in volumes)
    points = (on_surfaces + on_curves) * (1 + _WEIGHT_SHARE * rational)
    amounts = np.array([points, len(outlines.coedge_edge), len(parts.patch)])
    rates = np.array(_WRITE_SECONDS[kind]) + _SHAPE_SECONDS
    if check:
        rates += _CHECK_SECONDS
    return Estimate(
        faces=len(parts.patch),
        patches=len(np.unique(parts.patch)),
        edges=len(outlines.edges),
        control_points=on_surfaces,
        bytes=int(amounts @ _BYTES[kind]),
        seconds=float(_START_SECONDS + amounts @ rates),
    )
