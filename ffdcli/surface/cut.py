"""Cutting convex polygons by planes, conforming by construction.

An edge that a plane crosses gets one vertex, which every polygon with that edge uses, whether or
not that polygon is cut itself. Vertices and edges are told apart by number, never by coordinates,
nor edges by the vertices they join: a diagonal may run along another polygon's edge. A vertex close
to a plane lies on it and is not moved, so no edge too short to keep and no sliver arises (Feng
2002, Fig. 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import next_corners
from ffdcli.errors import CheckError


@dataclass(frozen=True)
class Pieces:
    """Convex pieces of the input triangles.

    Parameters
    ----------
    vertices : (V, 3 n) float64
        Coordinates in the frames of n volumes, side by side. The mesh's own vertices first,
        unmoved, then those made by cuts.
    corners : (C,) int64
    edges : (C,) int64
        Number of the edge from each corner to the next.
    starts : (N + 1,) int64
        Piece ``p`` has corners ``corners[starts[p]:starts[p + 1]]``, counter-clockwise.
    triangle : (N,) int64
        The triangle each piece was cut from.
    """

    vertices: Floats
    corners: Ints
    edges: Ints
    starts: Ints
    triangle: Ints

    @property
    def edge_count(self) -> int:
        """One more than the highest number of an edge."""
        return int(self.edges.max(initial=-1)) + 1

    @property
    def count(self) -> int:
        """Number of pieces."""
        return len(self.triangle)

    def bounds(self, axis: int) -> tuple[Floats, Floats]:
        """Lowest and highest coordinate of each piece along an axis (column of the vertices)."""
        values = self.vertices[self.corners, axis]
        first = self.starts[:-1]
        return np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)

    @property
    def owner(self) -> Ints:
        """(C,) piece of each corner."""
        return np.repeat(np.arange(self.count), np.diff(self.starts))


def from_triangles(vertices: Floats, triangles: Ints, sides: Ints) -> Pieces:
    """The uncut triangles (T, 3) of vertices (V, 3 n), with their edges (T, 3), as pieces."""
    starts = 3 * np.arange(len(triangles) + 1)
    return Pieces(vertices, triangles.ravel(), sides.ravel(), starts, np.arange(len(triangles)))


@dataclass(frozen=True)
class CutRule:
    """When a vertex counts as lying on a cutting plane.

    Parameters
    ----------
    snap : float
        It is no further from the plane than this.
    chord : float
        Or the cut would leave a chord shorter than this round it,
    reach : float
        and it is no further from the plane than this.
    """

    snap: float
    chord: float
    reach: float


def split(
    pieces: Pieces, axis: int, value: float, rule: CutRule, chosen: Bools
) -> tuple[Pieces, Ints]:
    """Cut the chosen pieces by the plane ``u_axis = value``.

    Parameters
    ----------
    axis : int
        Column of the vertices: ``3 v + a`` for axis a of volume v. Only there is a new vertex the
        plane's value to the bit; in other frames it lies on the same point to rounding.
    chosen : (N,) bool
        Pieces to be cut where they reach beyond the plane on both sides. Their neighbours get the
        new vertices too.
    rule : CutRule

    Returns
    -------
    Pieces
        The part below the plane stands in the place of the piece, the part above it at the end.
    (M,) int64
        The pieces that were cut, in the order of the parts at the end.
    """
    offset = pieces.vertices[:, axis] - value
    side = np.where(np.abs(offset) <= rule.snap, 0, np.sign(offset)).astype(np.int8)
    while True:
        hit = chosen & _straddling(pieces, side)
        if not hit.any():
            return pieces, np.empty(0, dtype=np.int64)
        frame = pieces.vertices[:, axis - axis % 3 :][:, :3]
        tips = _blunt_tips(pieces, frame, np.flatnonzero(hit), offset, side, rule)
        if not len(tips):
            break
        side[tips] = 0
    pieces, hit_side = _insert_crossings(pieces, axis, value, offset, side, hit)
    return _separate(pieces, hit, hit_side, max(rule.snap, rule.reach)), np.flatnonzero(hit)


def _straddling(pieces: Pieces, side: NDArray[np.int8]) -> Bools:
    """(N,) True for pieces with corners on both sides."""
    corner_side = side[pieces.corners]
    first = pieces.starts[:-1]
    below = np.minimum.reduceat(corner_side, first) < 0
    return np.asarray(below & (np.maximum.reduceat(corner_side, first) > 0))


def _blunt_tips(
    pieces: Pieces,
    vertices: Floats,
    which: Ints,
    offset: Floats,
    side: NDArray[np.int8],
    rule: CutRule,
) -> Ints:
    """Vertices round which the cut would leave too short a chord, and that may be left uncut.

    Without this a plane that passes just beside a vertex leaves a tip smaller than the tolerance
    of its own edges, which kernels that read the file collapse.
    """
    size = np.diff(pieces.starts)[which]
    corner = _ranges(np.zeros(len(which), dtype=np.int64), size, size, pieces.starts[which])
    first = np.cumsum(size) - size
    after = np.arange(1, len(corner) + 1)
    after[first + size - 1] = first
    tail, head = pieces.corners[corner], pieces.corners[corner[after]]
    # Where each side meets the plane: at a crossing, or at a corner that lies on it.
    crosses = side[tail] * side[head] < 0
    rise = np.where(crosses, offset[tail] - offset[head], 1.0)
    share = np.where(crosses, offset[tail] / rise, 0.0)[:, None]
    meets = vertices[tail] + share * (vertices[head] - vertices[tail])
    absent = ~(crosses | (side[tail] == 0))
    low = np.minimum.reduceat(np.where(absent[:, None], np.inf, meets), first, axis=0)
    high = np.maximum.reduceat(np.where(absent[:, None], -np.inf, meets), first, axis=0)
    short = np.linalg.norm(high - low, axis=1) < rule.chord
    height = offset[tail] * (side[tail] != 0)
    above, below = np.maximum.reduceat(height, first), -np.minimum.reduceat(height, first)
    upper = above <= below
    blunt = short & (np.minimum(above, below) <= rule.reach)
    piece = np.repeat(np.arange(len(which)), size)
    chosen = blunt[piece] & (side[tail] == np.where(upper, 1, -1)[piece])
    return np.unique(tail[chosen])


def _insert_crossings(
    pieces: Pieces, axis: int, value: float, offset: Floats, side: NDArray[np.int8], hit: Bools
) -> tuple[Pieces, Floats]:
    """New vertices on the crossed edges of the hit pieces, in every piece that has the edge."""
    corners, owner = pieces.corners, pieces.owner
    heads = corners[next_corners(pieces.starts)]
    crosses = side[corners] * side[heads] < 0
    count = len(pieces.vertices)
    asked = np.flatnonzero(crosses & hit[owner])
    cut, first = np.unique(pieces.edges[asked], return_index=True)
    low, high = np.sort(np.stack([corners, heads])[:, asked[first]], axis=0)
    # In the order of their vertices, which does not depend on how edges are numbered.
    order = np.lexsort([cut, high, low])
    cut, low, high = cut[order], low[order], high[order]
    # From the lower-numbered end, so that the point does not depend on the polygon that asks.
    share = offset[low] / (offset[low] - offset[high])
    made = pieces.vertices[low] + share[:, None] * (pieces.vertices[high] - pieces.vertices[low])
    made[:, axis] = value

    # There may be none: the plane may pass through two corners that lie on it already.
    number = np.full(pieces.edge_count, -1, dtype=np.int64)
    number[cut] = np.arange(len(cut))
    where = np.flatnonzero(number[pieces.edges] >= 0)
    made_by = number[pieces.edges[where]]
    # The half at the lower-numbered end keeps the edge's number.
    near, far = pieces.edges[where], len(number) + made_by
    rises = corners[where] < heads[where]
    edges = pieces.edges.copy()
    edges[where] = np.where(rises, near, far)
    added = np.bincount(owner[where], minlength=pieces.count)
    grown = Pieces(
        vertices=np.concatenate([pieces.vertices, made]),
        corners=np.insert(corners, where + 1, count + made_by),
        edges=np.insert(edges, where + 1, np.where(rises, far, near)),
        starts=pieces.starts + np.concatenate([[0], np.cumsum(added)]),
        triangle=pieces.triangle,
    )
    distance = np.where(side == 0, 0.0, offset)
    return grown, np.concatenate([distance, np.zeros(len(cut))])


def _separate(pieces: Pieces, hit: Bools, distance: Floats, dent: float) -> Pieces:
    """Part the hit pieces along the chord between the two ends of their upper run of corners.

    ``distance`` (V,) is each vertex's signed distance from the plane, 0 for those on it.
    """
    lengths = np.diff(pieces.starts)
    which = np.flatnonzero(hit)
    begin, length = _upper_runs(pieces, which, distance, dent)
    size = lengths[which]
    # The upper part is the run and the vertex on the plane at either end; the lower the rest.
    upper = _ranges(begin - 1, length + 2, size, pieces.starts[which])
    lower = _ranges(begin + length, size - length, size, pieces.starts[which])

    new_lengths = lengths.copy()
    new_lengths[which] = size - length
    starts = np.concatenate([[0], np.cumsum(np.concatenate([new_lengths, length + 2]))])
    total_low = int(starts[pieces.count])
    # Corners of the pieces before, in their order now; both parts end where the chord begins.
    source = np.empty(int(starts[-1]), dtype=np.int64)
    target = np.repeat(hit, new_lengths)
    source[:total_low][~target] = np.flatnonzero(np.repeat(~hit, lengths))
    source[:total_low][target] = lower
    source[total_low:] = upper
    edges = pieces.edges[source]
    chord = pieces.edge_count + np.arange(len(which))
    edges[starts[which + 1] - 1] = chord
    edges[starts[pieces.count + 1 :] - 1] = chord
    triangle = np.concatenate([pieces.triangle, pieces.triangle[which]])
    return Pieces(pieces.vertices, pieces.corners[source], edges, starts, triangle)


def _upper_runs(pieces: Pieces, which: Ints, distance: Floats, dent: float) -> tuple[Ints, Ints]:
    """Place of the first corner above the plane in each hit piece, and how many follow on.

    A convex polygon has one run. Corners that earlier planes took as lying on them may dent it
    slightly, so the run that reaches furthest is the one; the others must be as small as a dent.
    """
    starts, size = pieces.starts[which], np.diff(pieces.starts)[which]
    corner = _ranges(np.zeros(len(which), dtype=np.int64), size, size, starts)
    piece = np.repeat(np.arange(len(which)), size)
    place = corner - starts[piece]
    height = distance[pieces.corners[corner]]
    above = height > 0
    before = starts[piece] + (place - 1) % size[piece]
    enters = above & (distance[pieces.corners[before]] <= 0)
    # Number the runs in the order of corners; those that wrap round belong to the last of their
    # piece.
    entry = np.flatnonzero(enters)
    run_piece = piece[entry]
    run = np.cumsum(enters) - 1
    last = np.searchsorted(run_piece, np.arange(len(which)), side="right") - 1
    wraps = above & (run < np.searchsorted(run_piece, piece, side="left"))
    run = np.where(wraps, last[piece], run)
    runs = len(entry)
    reach = np.zeros(runs)
    np.maximum.at(reach, run[above], height[above])
    count = np.bincount(run[above], minlength=runs)
    order = np.lexsort([-reach, run_piece])
    best = order[np.searchsorted(run_piece[order], np.arange(len(which)), side="left")]
    dents = np.ones(runs, dtype=bool)
    dents[best] = False
    if np.any(reach[dents] > 4 * dent):
        raise CheckError("a polygon that should be convex is not; the cut was abandoned")
    return place[entry[best]], count[best]


def _ranges(begin: Ints, length: Ints, modulus: Ints, offset: Ints) -> Ints:
    """Concatenate ``offset + (begin, begin + 1, ...) % modulus`` of the given lengths."""
    total = int(length.sum())
    step = np.arange(total) - np.repeat(np.cumsum(length) - length, length)
    value = (np.repeat(begin, length) + step) % np.repeat(modulus, length)
    return np.asarray(np.repeat(offset, length) + value)
