"""Outlines of faces in surface parameters: inside tests, areas, sample points.

The outline of a face is the set of its pcurves as straight segments, in any order. A point is
inside if a ray from it crosses the outline an odd number of times.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, places_in_runs
from ffdcli.brep.evaluate.bspline import CurveBatch, sums
from ffdcli.brep.evaluate.lookup import Model

# Segments per polynomial piece of a curved pcurve.
PIECES = 64
# Largest distance of the poles of a straight pcurve from its chord, relative to their size.
STRAIGHT = 1e-13
# Pairs of a point and a segment per pass.
PAIRS = 2_000_000


# Place of sample lines within their strips. Not the middle: the middle line of a symmetric face
# runs through vertices whose pcurves may miss each other by a rounding.
OFF_CENTRE = 0.4871


@dataclass(frozen=True)
class TrimSegments:
    """Oriented segments in surface parameters, face after face.

    Parameters
    ----------
    starts : (F + 1,) int64
        Face ``f`` has segments ``starts[f]:starts[f + 1]``.
    face : (S,) int64
    ends : (S, 2, 2) float64, surface parameters
        From, to: counter-clockwise about the outward normal.
    """

    starts: Ints
    face: Ints
    ends: Floats


def expand(counts: Ints) -> tuple[Ints, Ints]:
    """Owner and place within the owner of ``counts[i]`` items for every i."""
    return np.repeat(np.arange(len(counts)), counts), places_in_runs(counts)


def passes(counts: Ints, limit: int = PAIRS) -> list[slice]:
    """Slices of consecutive items whose counts add up to about ``limit`` at most."""
    total = np.cumsum(counts)
    number = total // limit
    cuts = np.flatnonzero(np.diff(number)) + 1
    bounds = [0, *cuts.tolist(), len(counts)]
    return [slice(a, b) for a, b in pairwise(bounds) if b > a]


def outlines(model: Model) -> TrimSegments:
    """Oriented segments of all pcurves, and of the gaps between them at common vertices.

    Pcurves of reduced results miss each other by up to the tolerance. A ray through the gap would
    take all points of its line for outside, or inside.
    """
    coedges, ends = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2, 2))]
    for batch in model.pcurves:
        straight = _straight(batch)
        for rows, pieces in ((straight, 1), (~straight, PIECES)):
            owner, chords = _chop(model, batch, np.flatnonzero(rows), pieces)
            coedges.append(owner)
            ends.append(chords)
    coedge, segment = np.concatenate(coedges), np.concatenate(ends)
    backward = ~model.read.coedge_forward[coedge]
    segment[backward] = segment[backward, ::-1]
    after, gap = _gaps(model)
    coedge, segment = np.concatenate([coedge, after]), np.concatenate([segment, gap])
    face = model.read.face_of_coedge[coedge]
    order = np.argsort(face, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(face, minlength=model.read.face_count))])
    return TrimSegments(starts.astype(np.int64), face[order], segment[order])


def _gaps(model: Model) -> tuple[Ints, Floats]:
    """Coedges (n,) and segments (n, 2, 2) from the end of the pcurve before to their own start."""
    read = model.read
    number = np.arange(len(read.coedge_edge))
    starts, stops = read.loop_coedges[:-1], read.loop_coedges[1:]
    filled = stops > starts
    after = number + 1
    after[stops[filled] - 1] = starts[filled]
    forward = read.coedge_forward[:, None]
    span, vertex = read.edge_range[read.coedge_edge], read.edges[read.coedge_edge]
    span = np.where(forward, span, span[:, ::-1])
    vertex = np.where(forward, vertex, vertex[:, ::-1])
    first, last = (model.on_pcurves(number, span[:, side])[0] for side in (0, 1))
    gap = np.stack([last, first[after]], axis=1)
    joined = (vertex[:, 1] == vertex[after, 0]) & np.isfinite(gap).all(axis=(1, 2))
    joined &= np.any(gap[:, 0] != gap[:, 1], axis=1)
    return after[joined], gap[joined]


def _straight(batch: CurveBatch) -> Bools:
    """(m,) True where the poles lie on the chord and within it."""
    poles = batch.poles[..., :2]
    if batch.rational:
        poles = poles / batch.poles[..., 2:]
    arm = poles - poles[:, :1]
    chord = arm[:, -1:]
    across = arm[..., 0] * chord[..., 1] - arm[..., 1] * chord[..., 0]
    along = (arm * chord).sum(axis=2)
    squared = (chord * chord).sum(axis=2)
    slack = STRAIGHT * np.abs(poles).max(axis=(1, 2))[:, None] * np.sqrt(squared)
    inside = (along >= -slack) & (along <= squared + slack)
    return np.all((np.abs(across) <= slack) & inside, axis=1)


def _chop(model: Model, batch: CurveBatch, rows: Ints, pieces: int) -> tuple[Ints, Floats]:
    """Chords of pcurves, ``pieces`` per polynomial piece: coedges and ends of chords.

    With ``pieces`` 1 the chord of the whole pcurve, for straight ones.
    """
    read = model.read
    owner = batch.owners[rows]
    span = read.edge_range[read.coedge_edge[owner]]
    if pieces == 1:
        at = span
    else:
        knots = np.clip(batch.knots[rows], span[:, :1], span[:, 1:])
        inner = knots[:, :-1, None] + np.diff(knots, axis=1)[:, :, None] * (
            np.arange(pieces) / pieces
        )
        count = (knots.shape[1] - 1) * pieces
        at = np.concatenate([inner.reshape(len(rows), count), span[:, 1:]], axis=1)
    uv, _ = model.on_pcurves(np.repeat(owner, at.shape[1]), at.ravel())
    uv = uv.reshape(*at.shape, 2)
    chords = np.stack([uv[:, :-1], uv[:, 1:]], axis=2)
    return np.repeat(owner, at.shape[1] - 1), chords.reshape(-1, 2, 2)


def inside(lines: TrimSegments, face: Ints, uv: Floats) -> Bools:
    """(n,) True where the point ``uv`` (n, 2) lies within its face's outline."""
    result = np.zeros(len(face), dtype=bool)
    counts = np.diff(lines.starts)[face]
    for part in passes(counts):
        owner, place = expand(counts[part])
        if not len(owner):
            continue
        a, b = np.moveaxis(lines.ends[lines.starts[face[part]][owner] + place], 1, 0)
        point = uv[part][owner]
        crossing = (a[:, 1] <= point[:, 1]) != (b[:, 1] <= point[:, 1])
        owner, point, a, b = owner[crossing], point[crossing], a[crossing], b[crossing]
        ratio = (point[:, 1] - a[:, 1]) / (b[:, 1] - a[:, 1])
        right = point[:, 0] < a[:, 0] + ratio * (b[:, 0] - a[:, 0])
        count = np.bincount(owner[right], minlength=len(face[part]))
        result[part] = count % 2 == 1
    return result


def meets(lines: TrimSegments, face: Ints, low: Floats, high: Floats) -> Bools:
    """(n,) True where the rectangle ``low`` to ``high``, (n, 2) each, meets its face's inside."""
    result = inside(lines, face, (low + high) / 2)
    open_ = np.flatnonzero(~result)
    counts = np.diff(lines.starts)[face[open_]]
    for part in passes(counts):
        owner, place = expand(counts[part])
        if not len(owner):
            continue
        rectangle = open_[part][owner]
        ends = lines.ends[lines.starts[face[rectangle]] + place]
        half = (high - low)[rectangle] / 2
        ends = ends - ((low + high)[rectangle] / 2)[:, None]
        # Apart along a parameter, or on one side of the segment's line.
        apart = np.any((ends.min(axis=1) > half) | (ends.max(axis=1) < -half), axis=1)
        along = ends[:, 1] - ends[:, 0]
        across = np.abs(along[:, 0] * ends[:, 0, 1] - along[:, 1] * ends[:, 0, 0])
        apart |= across > np.abs(along[:, 0]) * half[:, 1] + np.abs(along[:, 1]) * half[:, 0]
        result[rectangle[~apart]] = True
    return result


def areas(lines: TrimSegments) -> Floats:
    """(F,) area in surface parameters, negative where the outline runs clockwise."""
    a, b = lines.ends[:, 0], lines.ends[:, 1]
    # Relative to a corner of the same face, so that distant faces lose no digits.
    corner = np.zeros((len(lines.starts) - 1, 2))
    held = np.diff(lines.starts) > 0
    corner[held] = lines.ends[lines.starts[:-1][held], 0]
    a, b = a - corner[lines.face], b - corner[lines.face]
    part = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    return sums(lines.face, part, len(held))


def spread(lines: TrimSegments, levels: Ints, shift: float = OFF_CENTRE) -> tuple[Ints, Floats]:
    """Spread points over the inside of every face.

    Each face is cut by ``levels[f]`` lines of constant second parameter; on every stretch of a
    line within the outline lie points at about the spacing that would put ``levels[f]`` across
    the whole face, and at least three.

    Returns
    -------
    face : (n,) int64
    uv : (n, 2) float64, surface parameters
    """
    faces, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2))]
    sizes = np.diff(lines.starts)
    wanted = np.flatnonzero(sizes * levels)
    for part in passes((sizes * levels)[wanted]):
        face, uv = _spread(lines, wanted[part], levels, shift)
        faces.append(face)
        points.append(uv)
    return np.concatenate(faces), np.concatenate(points)


def _spread(lines: TrimSegments, faces: Ints, levels: Ints, shift: float) -> tuple[Ints, Floats]:
    """Spread points over some faces, all of which have segments."""
    ends = lines.ends.reshape(-1, 2)
    corner, top = _extent(lines, faces)
    which, level = expand(levels[faces])
    height = corner[which, 1] + (top - corner)[which, 1] * (level + shift) / levels[faces][which]
    line, place = expand(np.diff(lines.starts)[faces][which])
    segment = 2 * (lines.starts[faces][which][line] + place)
    a, b = ends[segment], ends[segment + 1]
    y = height[line]
    crossing = (a[:, 1] <= y) != (b[:, 1] <= y)
    a, b, line, y = a[crossing], b[crossing], line[crossing], y[crossing]
    x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    # A line may cross an outline an odd number of times if pcurves miss each other by a rounding:
    # such lines are omitted.
    even = np.bincount(line, minlength=len(which)) % 2 == 0
    x, line = x[even[line]], line[even[line]]
    order = np.lexsort((x, line))
    x, line = x[order].reshape(-1, 2), line[order][::2]
    width = (top - corner)[which[line], 0]
    length = x[:, 1] - x[:, 0]
    share = np.divide(length, width, out=np.zeros_like(length), where=width > 0)
    count = np.maximum(3, np.ceil(share * levels[faces][which[line]])).astype(np.int64)
    count[length <= 0] = 0
    stretch, place = expand(count)
    u = x[stretch, 0] + length[stretch] * (place + 0.5) / count[stretch]
    row = line[stretch]
    return faces[which[row]], np.stack([u, height[row]], axis=1)


def _extent(lines: TrimSegments, faces: Ints) -> tuple[Floats, Floats]:
    """Lowest and highest parameters of some faces' outlines, (n, 2) each."""
    owner, place = expand(np.diff(lines.starts)[faces])
    segment = lines.ends[lines.starts[faces][owner] + place]
    first = np.flatnonzero(place == 0)
    return (
        np.minimum.reduceat(segment.min(axis=1), first),
        np.maximum.reduceat(segment.max(axis=1), first),
    )
