"""Curves in the parameters of surfaces (pcurves), and edges' curves with them, as entities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ffdcli.arrays import Bools, Ints, run_starts
from ffdcli.brep.occ.building.pcurve_uses import CoedgeUses
from ffdcli.brep.step.entities import Entities
from ffdcli.brep.step.planes import PlaneFrames, lengths, units
from ffdcli.brep.step.points import add_equal, add_points
from ffdcli.brep.step.splines import Lines, Spline, add_curves, add_lines
from ffdcli.brep.step.text import rounded

_CONTEXT = (
    b"(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()"
    b"REPRESENTATION_CONTEXT('2D SPACE',''))"
)
_STRAIGHT = (
    b"B_SPLINE_CURVE_WITH_KNOTS('',1,(#%d,#%d),.UNSPECIFIED.,.F.,.F.,(2,2),(0.,1.),"
    b".PIECEWISE_BEZIER_KNOTS.)"
)


@dataclass(frozen=True)
class EdgePcurves:
    """Pcurves of edges: each one's edge and entity (p,), and whether it is one of a seam."""

    edge: Ints
    number: Ints
    seam: Bools


def add_pcurves(
    entities: Entities,
    uses: CoedgeUses,
    frames: PlaneFrames,
    surface: Ints,
    lines: Lines,
    curves: Sequence[Spline],
    digits: int,
) -> EdgePcurves:
    """Add the curves of edges in the parameters of the surfaces at them.

    On B-spline surfaces they are the straight ones of the B-rep; in planes, the edges' own curves
    in the coordinates of the plane.

    Parameters
    ----------
    entities : Entities
    uses : CoedgeUses
    frames : PlaneFrames
    surface : (S,) int64
        Entities of the surfaces.
    lines, curves
        The curves of edges.
    digits : int
        Significant digits.
    """
    pairs = uses.pairs()
    twice = 1 + pairs.seam.astype(np.int64)
    (rows, planes), *others = _beside_planes(uses, [lines.edges, *(each.owners for each in curves)])
    straight = lines.take(rows)
    flat = [
        replace(each, points=rounded(frames.parameters(beside, each.points), digits))
        for each, beside in _taken(curves, others)
    ]
    starts, ends, *poles = add_points(
        entities,
        [
            rounded(frames.parameters(planes, straight.start), digits),
            rounded(pairs.ends, digits),
            *(each.points for each in flat),
        ],
    )
    directions = frames.directions(planes, straight.direction)
    # As in space, divided by the length once more.
    ways = [rounded(units(directions), digits)]
    (along,) = add_equal(entities, b"DIRECTION('',(%s))", ways)
    drawn = [
        entities.add(_STRAIGHT, ends),
        add_lines(entities, starts, along, rounded(lengths(directions), digits)),
        *(add_curves(entities, *each) for each in zip(flat, poles, strict=True)),
    ]
    beside = [np.repeat(pairs.surface, twice), planes, *(each for _, each in others)]
    edge = [np.repeat(pairs.edge, twice), straight.edges, *(each.owners for each in flat)]
    context = entities.one(_CONTEXT)
    template = b"DEFINITIONAL_REPRESENTATION('',(#%%d),#%d)" % context
    described = entities.add(template, np.concatenate(drawn))
    number = entities.add(b"PCURVE('',#%d,#%d)", surface[np.concatenate(beside)], described)
    seam = np.zeros(len(number), dtype=bool)
    seam[: len(beside[0])] = np.repeat(pairs.seam, twice)
    return EdgePcurves(np.concatenate(edge), number, seam)


def _beside_planes(uses: CoedgeUses, groups: Sequence[Ints]) -> list[tuple[Ints, Ints]]:
    """For each group of edges, the rows of those beside planes and the planes, in pairs."""
    brep = uses.brep
    count = brep.surface_count
    keys = brep.coedge_edge * count + brep.face_surface[uses.face]
    edge, plane = np.divmod(np.unique(keys[uses.on_plane]), count)
    owner, row = np.full(len(brep.edges), -1), np.zeros(len(brep.edges), dtype=np.int64)
    for number, edges in enumerate(groups):
        owner[edges], row[edges] = number, np.arange(len(edges))
    order = np.argsort(owner[edge], kind="stable")
    bounds = np.searchsorted(owner[edge[order]], np.arange(len(groups) + 1))
    chosen = [order[begin:end] for begin, end in pairwise(bounds.tolist())]
    return [(row[edge[each]], plane[each]) for each in chosen]


def _taken(
    curves: Sequence[Spline], pairs: Sequence[tuple[Ints, Ints]]
) -> Iterator[tuple[Spline, Ints]]:
    """Yield the curves of each batch that are beside planes, and the planes."""
    for each, (rows, planes) in zip(curves, pairs, strict=True):
        yield each.take(rows), planes


def curves_with_pcurves(entities: Entities, curve: Ints, found: EdgePcurves) -> Ints:
    """Add the curves (E,) of edges together with their pcurves: the numbers of both (E,)."""
    order = np.argsort(found.edge, kind="stable")
    uses = np.bincount(found.edge, minlength=len(curve))
    first = run_starts(uses)
    seam = np.zeros(len(curve), dtype=bool)
    seam[found.edge[found.seam]] = True
    joined = curve.copy()
    for kind, wanted in ((b"SURFACE_CURVE", ~seam), (b"SEAM_CURVE", seam)):
        for count in np.unique(uses[wanted & (uses > 0)]).tolist():
            edges = np.flatnonzero(wanted & (uses == count))
            members = found.number[order[first[edges, None] + np.arange(count)]]
            places = b",".join([b"#%d"] * count)
            template = b"%s('',#%%d,(%s),.PCURVE_S1.)" % (kind, places)
            joined[edges] = entities.add(template, curve[edges], members)
    return joined
