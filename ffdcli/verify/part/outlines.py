"""Points whose nearest points lie outside the outlines of the other side's faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.verify.part.pair import Pair
from ffdcli.verify.part.reasons import Names, off_outline
from ffdcli.verify.part.search import Target, measure


def outside_outlines(pair: Pair, names: Names) -> list[str]:
    """Messages for points whose feet lie outside the outlines of the other side's faces.

    A foot near the outline may lie outside by rounding or by the deviation. So the point must also
    be far from the lines of that face.
    """
    reasons = []
    # A foot within the tolerance, and an outline within it of that.
    limit = 3 * pair.tolerance
    for found, own, other, spots, others in (
        (pair.found[0], pair.part, pair.file, pair.lines[1], pair.faces[1]),
        (pair.found[1], pair.file, pair.part, pair.lines[0], pair.faces[0]),
    ):
        near = np.flatnonzero((found.feet.owner >= 0) & (found.feet.distance <= pair.tolerance))
        face, params = found.feet.owner[near], found.feet.params[near]
        out = ~other.shape.inside(face, params)
        out[out] = ~other.shape.surely_inside(face[out], params[out])
        which = near[out]
        known = found.spots.take(which)
        which = which[own.shape.surely_inside(known.owner, known.params)]
        away = np.zeros(len(which))
        edges = len(other.shape.edges)
        coedge_face = np.concatenate([np.full(edges, -1), other.shape.coedge_face])
        for one in np.unique(found.feet.owner[which]):
            mine = np.flatnonzero(found.feet.owner[which] == one)
            border = spots.take(np.flatnonzero(coedge_face[spots.owner] == one))
            points = found.spots.position[which[mine]]
            away[mine] = _anywhere(Target.lines(other, border), points, pair.settle, limit)
        far = np.flatnonzero(away > limit)
        if len(far) and not pair.ordered:
            # Another face may be there, too.
            target = replace(Target.faces(other, others), accept=other.shape.inside)
            points = found.spots.position[which[far]]
            away[far] = np.minimum(away[far], _anywhere(target, points, pair.settle, limit))
        reasons += off_outline(found, which, away, limit, names)
    return reasons


def _anywhere(target: Target, points: Floats, settle: float, limit: float) -> Floats:
    """Distances of points (n, 3) from the nearest of all faces or lines of a target."""
    count = len(points)
    start = np.zeros((count, len(target.breaks[0])))
    owner, same = np.full(count, -1), np.zeros(count, dtype=bool)
    return measure(target, owner, start, same, points, settle, limit, prove=False).distance
