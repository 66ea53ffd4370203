"""Check of a boundary representation without OpenCascade: topology, volumes, gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.closedness import describe, edge_faults, unchained_loops
from ffdcli.brep.evaluate.face_points import edge_points, pcurve_gaps
from ffdcli.brep.evaluate.integrate import centre_of, mass_properties
from ffdcli.brep.evaluate.lookup import Model, model_of_brep
from ffdcli.brep.evaluate.trim import areas, outlines
from ffdcli.brep.record import Brep, MassProperties
from ffdcli.errors import CheckError


@dataclass(frozen=True)
class BrepReport:
    """Findings of :func:`check_brep`.

    Parameters
    ----------
    faults : tuple of str
        One sentence for each kind of fault, naming the first place; empty for a good record.
    watertight : bool
        Every edge is used twice, in opposite senses, and there is a solid.
    shell_volumes, solid_volumes : (S,), (number of solids,) float64, cubed model length
        Negative for cavities, meaningless for open shells.
    edge_gaps : (E,) float64, model length
        Largest sampled distance between an edge's curve and its pcurves on the faces.
    vertex_gaps : (E, 2) float64, model length
        Distance of each edge's curve from its start and end vertex.
    solids : tuple of MassProperties
    """

    faults: tuple[str, ...]
    watertight: bool
    shell_volumes: Floats
    solid_volumes: Floats
    edge_gaps: Floats
    vertex_gaps: Floats
    solids: tuple[MassProperties, ...]


def require_sound(brep: Brep, hint: str) -> tuple[MassProperties, ...]:
    """Check a B-rep by our own arithmetic, and return the mass properties of its solids.

    Parameters
    ----------
    brep : Brep
    hint : str
        What to tell users where it is not sound.

    Raises
    ------
    CheckError
        The B-rep is not a sound solid or shell.
    """
    report = check_brep(brep)
    if report.faults:
        raise CheckError("the result failed its own check: " + "; ".join(report.faults), hint=hint)
    return report.solids


def check_brep(brep: Brep) -> BrepReport:
    """Check a record, without OpenCascade.

    Edges of closed shells are used twice in opposite senses; loops are closed chains; the sense of
    faces agrees with their outlines; solids have positive and cavities negative volume; every
    edge's curve agrees with its pcurves on their surfaces, and with its vertices, within the
    record's tolerances.
    """
    model = model_of_brep(brep)
    lines = outlines(model)
    faults: list[str] = []
    ending, wrong = edge_faults(brep)
    in_closed = np.zeros(len(brep.edges), dtype=bool)
    closed = brep.shell_closed[brep.face_shell[brep.face_of_coedge]]
    in_closed[brep.coedge_edge[closed]] = True
    _edges(faults, brep, ending & in_closed, "end of a shell that should be closed")
    _edges(faults, brep, wrong, "used twice in the same sense or more than twice")
    unchained = unchained_loops(brep)
    if len(unchained):
        face = int(np.searchsorted(brep.face_loops, unchained[0], side="right")) - 1
        faults.append(f"{len(unchained)} loops are not closed chains, the first on face {face + 1}")
    faults.extend(turned_faces(model, areas(lines)))
    shells, solids, properties = mass_properties(model, lines, centre_of(model))
    span = float(np.linalg.norm(np.ptp(brep.points, axis=0))) if len(brep.points) else 0.0
    noise = 64 * np.finfo(float).eps * span * np.array([solid.area for solid in properties])
    faults.extend(wrong_volumes(brep.shell_solid, shells, solids, noise))
    gaps, ends = edge_gaps(model)
    rounding = 64 * np.finfo(float).eps * float(np.abs(brep.points).max(initial=0.0))
    over = gaps > brep.edge_tolerance + rounding
    if over.any():
        worst = int(np.argmax(np.where(over, gaps - brep.edge_tolerance, -np.inf)))
        faults.append(
            f"{over.sum()} edges leave their faces by more than their tolerance, the worst at "
            f"{describe(brep.points[brep.edges[worst, 0]])} by {gaps[worst]:.3g}"
        )
    off = ends > brep.vertex_tolerance[brep.edges] + rounding
    if off.any():
        edge, side = np.argwhere(off)[0]
        faults.append(
            f"{off.sum()} edge ends miss their vertices by more than their tolerance, the first "
            f"at {describe(brep.points[brep.edges[edge, side]])} by {ends[edge, side]:.3g}"
        )
    watertight = brep.solid_count > 0 and not ending.any() and not wrong.any()
    return BrepReport(tuple(faults), watertight, shells, solids, gaps, ends, tuple(properties))


def _edges(faults: list[str], brep: Brep, bad: Bools, what: str) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        place = brep.points[brep.edges[first]].mean(axis=0)
        faults.append(f"{bad.sum()} edges are {what}, the first near {describe(place)}")


def turned_faces(model: Model, area: Floats) -> list[str]:
    """Messages for faces whose sense contradicts their outlines, and for empty outlines."""
    sense = np.where(model.read.face_reversed, -1.0, 1.0)
    faults = []
    for bad, what in (
        (area * sense < 0, "turned against their outlines (flipped)"),
        (area == 0, "without area inside their outlines"),
    ):
        if bad.any():
            first = int(np.argmax(bad))
            faults.append(f"{bad.sum()} faces are {what}, the first face {first + 1} of {len(bad)}")
    return faults


def wrong_volumes(
    shell_solid: Ints, shells: Floats, solids: Floats, noise: Floats | float = 0.0
) -> list[str]:
    """Messages for solids that are inside out or empty, and shells that face the wrong way.

    Volumes up to ``noise``, the level of rounding errors, count as empty.
    """
    faults = [
        f"solid {solid + 1} is inside out or encloses nothing (volume {solids[solid]:.6g})"
        for solid in np.flatnonzero(~(solids > noise))
    ]
    for solid in np.flatnonzero(solids > 0):
        own = np.flatnonzero(shell_solid == solid)
        outer = own[np.argmax(np.abs(shells[own]))]
        faults += [
            f"shell {shell + 1} of solid {solid + 1} faces the wrong way"
            for shell in own
            if (shells[shell] > 0) != (shell == outer)
        ]
    return faults


def edge_gaps(model: Model) -> tuple[Floats, Floats]:
    """Distances of edges' curves from their pcurves' images (E,) and from their vertices (E, 2).

    Infinite for an edge without a curve or with a missing pcurve; 0 at missing vertices.
    """
    read = model.read
    on_edges = edge_points(model)
    gaps = np.zeros(len(read.edges))
    np.maximum.at(gaps, read.coedge_edge, pcurve_gaps(model, on_edges))
    number = np.arange(len(read.edges))
    ends = np.zeros((len(read.edges), 2))
    for side in (0, 1):
        at, _ = model.on_edges(number, read.edge_range[:, side])
        vertex = read.edges[:, side]
        if len(read.points):
            gap = np.linalg.norm(at - read.points[vertex], axis=1)
            ends[:, side] = np.where(vertex >= 0, np.nan_to_num(gap, nan=np.inf), 0.0)
    return gaps, ends
