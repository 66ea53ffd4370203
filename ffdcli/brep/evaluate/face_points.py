"""Sample points on faces and edges, and distances of points from trimmed faces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.branch_and_bound import Sheets, search_all
from ffdcli.brep.evaluate.bspline import groups, sums, surface_positions
from ffdcli.brep.evaluate.lookup import Model
from ffdcli.brep.evaluate.nearest import (
    Feet,
    Seeds,
    Solver,
    improve,
    nearest,
    unknown,
)
from ffdcli.brep.evaluate.trim import TrimSegments, expand, inside, meets, spread

# Points on every polynomial piece of an edge; largest number of sample lines across a face.
EDGE_POINTS = 4
MOST_LEVELS = 256


@dataclass(frozen=True)
class FacePoints:
    """Points inside the outlines of faces.

    Parameters
    ----------
    face : (n,) int64
    uv : (n, 2) float64, surface parameters
    position : (n, 3) float64, model length
    normal : (n, 3) float64
        Outward according to the faces' senses; not normalised.
    """

    face: Ints
    uv: Floats
    position: Floats
    normal: Floats


@dataclass(frozen=True)
class EdgePoints:
    """Points on edges: edge (n,), parameter (n,), position (n, 3)."""

    edge: Ints
    at: Floats
    position: Floats


def face_points(model: Model, lines: TrimSegments, wanted: int) -> FacePoints:
    """Spread about ``wanted`` points over all faces by area, at least nine on each."""
    count = model.read.face_count
    levels = np.full(count, 3, dtype=np.int64)
    face, uv = _every_face(lines, levels)
    _, tangents = model.on_faces(face, uv)
    number = np.maximum(np.bincount(face, minlength=count), 1)
    stretch = np.linalg.norm(np.cross(tangents[:, 0], tangents[:, 1]), axis=1)
    mean = sums(face, np.nan_to_num(stretch), count) / number
    area = mean * _rectangle(lines, count)
    share = wanted * area / area.sum() if area.sum() > 0 else np.zeros(count)
    levels = np.maximum(levels, np.ceil(np.sqrt(share)).astype(np.int64))
    for batch in model.faces:
        # Every strip between knot lines gets samples: a wrong control point affects only a few
        # strips.
        strips = max(len(batch.v_mults), len(batch.u_mults)) - 1
        levels[batch.owners] = np.maximum(levels[batch.owners], 3 * strips)
    face, uv = _every_face(lines, np.minimum(levels, MOST_LEVELS))
    position, tangents = model.on_faces(face, uv)
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    normal[model.read.face_reversed[face]] *= -1
    return FacePoints(face, uv, position, normal)


def _every_face(lines: TrimSegments, levels: Ints) -> tuple[Ints, Floats]:
    """Spread points over every face; a second set of lines serves faces that the first missed."""
    face, uv = spread(lines, levels)
    missed = np.ones(len(levels), dtype=bool)
    missed[face] = False
    if not missed.any():
        return face, uv
    again, more = spread(lines, np.where(missed, 2 * levels + 1, 0), shift=0.382)
    return np.concatenate([face, again]), np.concatenate([uv, more])


def _rectangle(lines: TrimSegments, count: int) -> Floats:
    """(F,) area of the bounding rectangle of each outline, in surface parameters."""
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    held = np.flatnonzero(np.diff(lines.starts) > 0)
    low[held] = np.minimum.reduceat(lines.ends.min(axis=1), lines.starts[held])
    high[held] = np.maximum.reduceat(lines.ends.max(axis=1), lines.starts[held])
    size = np.zeros((count, 2))
    size[held] = high[held] - low[held]
    product: Floats = size[:, 0] * size[:, 1]
    return product


def edge_points(model: Model) -> EdgePoints:
    """Points on every polynomial piece of every edge, and at both ends."""
    read = model.read
    edges, ats = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for batch in model.curves:
        span = read.edge_range[batch.owners]
        knots = np.clip(batch.knots, span[:, :1], span[:, 1:])
        knots[:, 0], knots[:, -1] = span[:, 0], span[:, 1]
        step = (np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS
        inner = knots[:, :-1, None] + np.diff(knots, axis=1)[:, :, None] * step
        at = np.concatenate([span[:, :1], inner.reshape(len(span), -1), span[:, 1:]], axis=1)
        edges.append(np.repeat(batch.owners, at.shape[1]))
        ats.append(at.ravel())
    edge, at = np.concatenate(edges), np.concatenate(ats)
    order = np.argsort(edge, kind="stable")
    edge, at = edge[order], at[order]
    return EdgePoints(edge, at, model.on_edges(edge, at)[0])


def pcurve_gaps(model: Model, on_edges: EdgePoints) -> Floats:
    """(C,) largest sampled distance between each coedge's pcurve and its edge's curve.

    Infinite where a coedge has no pcurve or its edge no curve.
    """
    read = model.read
    gaps = np.full(len(read.coedge_edge), np.inf)
    sizes = np.bincount(on_edges.edge, minlength=len(read.edges))
    first = np.cumsum(sizes) - sizes
    known = np.flatnonzero((sizes[read.coedge_edge] > 0) & (model.pcurve_at[0] >= 0))
    step = 100_000
    for begin in range(0, len(known), step):
        coedges = known[begin : begin + step]
        owner, place = expand(sizes[read.coedge_edge[coedges]])
        coedge = coedges[owner]
        sample = first[read.coedge_edge[coedge]] + place
        uv, _ = model.on_pcurves(coedge, on_edges.at[sample])
        on_surface = model.positions_on_faces(model.read.face_of_coedge[coedge], uv)
        gap = np.linalg.norm(on_surface - on_edges.position[sample], axis=1)
        gap = np.where(np.isnan(gap), np.inf, gap)
        gaps[coedges] = np.maximum.reduceat(gap, np.flatnonzero(place == 0))
    return gaps


def distances(
    model: Model,
    lines: TrimSegments,
    spots: FacePoints,
    on_edges: EdgePoints,
    points: Floats,
    hints: Ints,
    settle: float,
    enough: float,
    tolerance: float,
) -> Feet:
    """Find the nearest point of the trimmed faces for every point (n, 3).

    Parameters
    ----------
    hints : (n,) int64
        Index of a face point that is likely near the point, -1 for none.
    settle, enough : float, model length
        As in :class:`ffdcli.brep.evaluate.nearest.Solver`.
    tolerance : float, model length
        Points found farther than this are searched for by bounds.

    Returns
    -------
    Feet
        The owner is a face; -1 where the foot lies on an edge.
    """
    domain = model.domain

    def confine(face: Ints, uv: Floats) -> Floats:
        return np.clip(uv, domain[face, 0], domain[face, 1])

    def accept(face: Ints, uv: Floats) -> Bools:
        return inside(lines, face, uv)

    solver = Solver(model.on_faces, confine, accept, settle, enough, tolerance)
    feet = unknown(len(points), 2)
    if len(spots.face):
        seeds = Seeds(spots.face, spots.uv, cKDTree(spots.position))
        feet = nearest(seeds, solver, points, feet, 1)
        hinted = np.flatnonzero((feet.distance > settle) & (hints >= 0))
        spot = hints[hinted]
        feet = improve(solver, points, feet, hinted, spots.face[spot], spots.uv[spot])
        feet = _nearer_edges(model, on_edges, points, solver, feet)
        feet = nearest(seeds, solver, points, feet, 4)
        feet = nearest(seeds, solver, points, feet, 12)
    else:
        feet = _nearer_edges(model, on_edges, points, solver, feet)
    if not np.any(feet.distance > tolerance):
        return feet
    face, sheets = _sheets(model, lines)

    def within(piece: Ints, uv: Floats) -> Floats:
        return np.clip(uv, sheets.low[piece], sheets.high[piece])

    pieces = Solver(
        lambda piece, uv: model.on_faces(face[piece], uv),
        within,
        lambda piece, uv: accept(face[piece], uv),
        settle,
        enough,
    )
    found = search_all(sheets, pieces, points, feet, tolerance)
    owner, better = feet.owner.copy(), np.flatnonzero(found.owner >= 0)
    owner[better] = face[found.owner[better]]
    return replace(found, owner=owner)


def _sheets(model: Model, lines: TrimSegments) -> tuple[Ints, Sheets]:
    """The polynomial pieces of all faces that their outlines hold, and the face of each."""
    faces, corners = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2, 2))]
    for batch in model.faces:
        u = np.stack([batch.u_knots[:, :-1], batch.u_knots[:, 1:]], axis=2)
        v = np.stack([batch.v_knots[:, :-1], batch.v_knots[:, 1:]], axis=2)
        shape = (len(u), u.shape[1], v.shape[1], 2)
        rectangle = np.stack(
            [np.broadcast_to(u[:, :, None], shape), np.broadcast_to(v[:, None], shape)], axis=4
        )
        faces.append(np.repeat(batch.owners, shape[1] * shape[2]))
        corners.append(rectangle.reshape(-1, 2, 2))
    face, corner = np.concatenate(faces), np.concatenate(corners)
    held = meets(lines, face, corner[:, 0], corner[:, 1])
    face, corner = face[held], corner[held]
    batch_of, row_of = model.face_at

    def at(piece: Ints, uv: Floats) -> Floats:
        owner = face[piece]
        values = np.ones((len(owner), 4))
        for number, part in groups(batch_of[owner]):
            batch = model.faces[number]
            plain = replace(batch, rational=False)
            points = surface_positions(plain, row_of[owner[part]], uv[part])
            values[part, : points.shape[1]] = points
        return values

    return face, Sheets(
        corner[:, 0],
        corner[:, 1],
        at,
        max((max(batch.degrees) for batch in model.faces), default=1),
        True,
        lambda uv: uv,
        lambda piece, low, high: meets(lines, face[piece], low, high),
    )


def _nearer_edges(
    model: Model, on_edges: EdgePoints, points: Floats, solver: Solver, feet: Feet
) -> Feet:
    """Improve distances by those from edges, then by those from the faces that meet there.

    The nearest point of a trimmed face may lie on its outline, or on a neighbour beyond it.
    """
    asked = np.flatnonzero(feet.distance > solver.settle)
    if not len(on_edges.edge) or not len(asked):
        return feet
    span = model.read.edge_range

    def evaluate(edge: Ints, at: Floats) -> tuple[Floats, Floats]:
        return model.on_edges(edge, at[:, 0])

    def confine(edge: Ints, at: Floats) -> Floats:
        return np.clip(at, span[edge, :1], span[edge, 1:])

    def accept(edge: Ints, at: Floats) -> Bools:
        return np.ones(len(edge), dtype=bool)

    seeds = Seeds(on_edges.edge, on_edges.at[:, None], cKDTree(on_edges.position))
    along = Solver(evaluate, confine, accept, solver.settle, solver.enough)
    found = nearest(seeds, along, points[asked], unknown(len(asked), 1), 4)
    nearer = found.distance < feet.distance[asked]
    distance, owner = feet.distance.copy(), feet.owner.copy()
    distance[asked[nearer]] = found.distance[nearer]
    owner[asked[nearer]] = -1
    feet = replace(feet, distance=distance, owner=owner)

    going = np.flatnonzero((feet.distance[asked] > solver.settle) & (found.owner >= 0))
    order = np.argsort(model.read.coedge_edge, kind="stable")
    uses = np.bincount(model.read.coedge_edge, minlength=len(model.read.edges))
    row, place = expand(uses[found.owner[going]])
    row = going[row]
    coedge = order[(np.cumsum(uses) - uses)[found.owner[row]] + place]
    start, _ = model.on_pcurves(coedge, found.params[row, 0])
    return improve(solver, points, feet, asked[row], model.read.face_of_coedge[coedge], start)
