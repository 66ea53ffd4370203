"""Points, curves, surfaces and curves on surfaces as entities; equal points are one entity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.brep.occ.building.pcurve_uses import CoedgeUses
from ffdcli.brep.record import Brep
from ffdcli.brep.step.entities import Entities
from ffdcli.brep.step.pcurves import add_pcurves, curves_with_pcurves
from ffdcli.brep.step.planes import frames_of, lengths, units
from ffdcli.brep.step.points import add_equal, add_points
from ffdcli.brep.step.splines import (
    Lines,
    Spline,
    add_curves,
    add_lines,
    add_surfaces,
    check_ranges,
    spline_curves,
    spline_surfaces,
)
from ffdcli.brep.step.text import rounded
from ffdcli.errors import KernelError


@dataclass(frozen=True)
class Geometry:
    """Numbers of the entities of a B-rep's geometry.

    Parameters
    ----------
    point : (V,) int64
        Of the vertices; 0 for those of no edge.
    curve : (E,) int64
        The curve of each edge, with its pcurves where they are written; 0 for edges of no face.
    surface : (S,) int64
        0 for surfaces of no face.
    """

    point: Ints
    curve: Ints
    surface: Ints


def add_geometry(entities: Entities, brep: Brep, *, pcurves: bool, digits: int) -> Geometry:
    """Add the points, curves and surfaces that faces use.

    Parameters
    ----------
    entities : Entities
    brep : Brep
    pcurves : bool
        Give edges their curves in the parameters of their faces too.
    digits : int
        Significant digits; 17 name every double.

    Raises
    ------
    KernelError
        Numbers that no curve or surface can have.
    """
    uses = CoedgeUses(brep)
    used = _marked(len(brep.edges), brep.coedge_edge)
    lines, curves = _curves(brep, used, uses.straight, digits)
    trimmed = _marked(brep.surface_count, brep.face_surface)
    surfaces = [
        spline_surfaces(batch, trimmed[batch.surfaces], digits)
        for batch in brep.surfaces
        if trimmed[batch.surfaces].any()
    ]
    _require_sound(curves, surfaces)
    frames = frames_of(brep.planes, brep.surface_count, rounded(brep.planes.origin, digits))
    flat = np.flatnonzero(trimmed[brep.planes.surfaces])
    corners = np.unique(brep.edges[used])
    point = np.zeros(len(brep.points), dtype=np.int64)
    point[corners], starts, origins, *poles = add_points(
        entities,
        [
            rounded(brep.points[corners], digits),
            lines.start,
            frames.origin[flat],
            *(each.points for each in (*curves, *surfaces)),
        ],
    )
    along, normals, x_axes = add_equal(
        entities,
        b"DIRECTION('',(%s))",
        [
            rounded(each, digits)
            # OpenCascade divides by the length when it makes the line, and when it writes it.
            for each in (units(lines.direction), frames.normal[flat], frames.x_axis[flat])
        ],
    )
    surface = np.zeros(brep.surface_count, dtype=np.int64)
    placed = entities.add(b"AXIS2_PLACEMENT_3D('',#%d,#%d,#%d)", origins, normals, x_axes)
    surface[brep.planes.surfaces[flat]] = entities.add(b"PLANE('',#%d)", placed)
    for each, numbers in zip(surfaces, poles[len(curves) :], strict=True):
        surface[each.owners] = add_surfaces(entities, each, numbers)
    curve = np.zeros(len(brep.edges), dtype=np.int64)
    curve[lines.edges] = add_lines(
        entities, starts, along, rounded(lengths(lines.direction), digits)
    )
    for each, numbers in zip(curves, poles[: len(curves)], strict=True):
        curve[each.owners] = add_curves(entities, each, numbers)
    if pcurves:
        found = add_pcurves(entities, uses, frames, surface, lines, curves, digits)
        curve = curves_with_pcurves(entities, curve, found)
    return Geometry(point, curve, surface)


def _curves(brep: Brep, used: Bools, straight: Bools, digits: int) -> tuple[Lines, list[Spline]]:
    """The curves of edges that are used: lines, and splines by batches."""
    edges, ends, splines = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2, 3))], []
    for batch in brep.curves:
        line = straight[batch.edges]
        bent = used[batch.edges] & ~line
        if bent.any():
            splines.append(spline_curves(batch, bent, digits))
        line = line & used[batch.edges]
        if line.any():
            edges.append(batch.edges[line])
            ends.append(batch.poles[line])
    points = np.concatenate(ends)
    direction = units(points[:, 1] - points[:, 0])
    return Lines(np.concatenate(edges), rounded(points[:, 0], digits), direction), splines


def _marked(count: int, numbers: Ints) -> Bools:
    marks = np.zeros(count, dtype=bool)
    marks[numbers] = True
    return marks


def _require_sound(curves: Sequence[Spline], surfaces: Sequence[Spline]) -> None:
    for what, splines in (("curve of edge", curves), ("surface", surfaces)):
        for spline in splines:
            wrong = check_ranges(spline)
            if wrong:
                raise KernelError(f"the {what} {spline.owners[0]} or one like it: {wrong}")
