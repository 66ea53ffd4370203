"""Convex polygons, and cuts of them by planes that leave no T-vertices.

An edge that a plane crosses gets one new vertex, which all polygons with that edge share, cut or
not. Vertices and edges are identified by number, never by coordinates, and edges not by their
vertices either: a diagonal may run along another polygon's edge. A vertex near a plane counts as
lying on it and is not moved, so cuts make no short edges and no slivers (Feng 2002, Fig. 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Floats, Ints, gather_runs, places_in_runs, run_numbers, run_starts
from ffdcli.corners import next_corners
from ffdcli.errors import CheckError


@dataclass(frozen=True)
class Pieces:
    """Convex pieces of the input triangles.

    Parameters
    ----------
    vertices : (V, n, 3) float64
        Coordinates in the frames of n volumes. The mesh's vertices come first, unmoved, then those
        that cuts made.
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

    def bounds(self, volume: int, axis: int) -> tuple[Floats, Floats]:
        """Lowest and highest coordinate (N,) of each piece along an axis of a volume's frame."""
        values = self.vertices[self.corners, volume, axis]
        first = self.starts[:-1]
        return np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)

    @property
    def owner(self) -> Ints:
        """(C,) piece that each corner belongs to."""
        return run_numbers(self.starts)


def from_triangles(vertices: Floats, triangles: Ints, sides: Ints) -> Pieces:
    """The uncut triangles (T, 3) of vertices (V, n, 3), with their edges (T, 3), as pieces."""
    starts = 3 * np.arange(len(triangles) + 1)
    return Pieces(vertices, triangles.ravel(), sides.ravel(), starts, np.arange(len(triangles)))


@dataclass(frozen=True)
class CutRule:
    """Distances within which a vertex counts as lying on a cutting plane.

    Parameters
    ----------
    snap : float
        A vertex no further from the plane than this lies on it.
    chord : float
        So does a vertex round which the cut would leave a chord shorter than this,
    reach : float
        if it is no further from the plane than this.
    """

    snap: float
    chord: float
    reach: float


@dataclass(frozen=True)
class CutPlane:
    """The plane ``u_axis = value`` in the frame of a volume, and the rule for vertices near it."""

    volume: int
    axis: int
    value: float
    rule: CutRule


def split(pieces: Pieces, plane: CutPlane, chosen: Bools) -> tuple[Pieces, Ints]:
    """Cut the chosen pieces by a plane.

    Parameters
    ----------
    pieces : Pieces
    plane : CutPlane
        New vertices have exactly its value as coordinate; in other frames they lie on it to
        rounding.
    chosen : (N,) bool
        Pieces to cut where they reach beyond the plane on both sides. Their neighbours get the
        new vertices too.

    Returns
    -------
    Pieces
        The part below the plane replaces the piece, the part above it is appended.
    (M,) int64
        The pieces that were cut, in the order of the appended parts.

    Raises
    ------
    CheckError
        A piece is not convex.
    """
    rule = plane.rule
    offset = pieces.vertices[:, plane.volume, plane.axis] - plane.value
    side = np.where(np.abs(offset) <= rule.snap, 0, np.sign(offset)).astype(np.int8)
    while True:
        hit = chosen & _straddling(pieces, side)
        if not hit.any():
            return pieces, np.empty(0, dtype=np.int64)
        tips = _blunt_tips(pieces, plane, np.flatnonzero(hit), offset, side)
        if not len(tips):
            break
        side[tips] = 0
    pieces, hit_side = _insert_crossings(pieces, plane, offset, side, hit)
    return _separate(pieces, hit, hit_side, max(rule.snap, rule.reach)), np.flatnonzero(hit)


def _straddling(pieces: Pieces, side: NDArray[np.int8]) -> Bools:
    """(N,) True for pieces with corners on both sides."""
    corner_side = side[pieces.corners]
    first = pieces.starts[:-1]
    below = np.minimum.reduceat(corner_side, first) < 0
    return np.asarray(below & (np.maximum.reduceat(corner_side, first) > 0))


def _blunt_tips(
    pieces: Pieces, plane: CutPlane, which: Ints, offset: Floats, side: NDArray[np.int8]
) -> Ints:
    """Vertices of pieces (m,) that the plane passes so closely that the chord would be too short.

    Otherwise a plane just beside a vertex leaves a tip smaller than the tolerance of its edges,
    which CAD kernels collapse when they read the file.
    """
    vertices, rule = pieces.vertices[:, plane.volume], plane.rule
    starts, corner = gather_runs(pieces.starts, which)
    first = starts[:-1]
    tail, head = pieces.corners[corner], pieces.corners[corner[next_corners(starts)]]
    # A side meets the plane at a crossing, or at a corner that lies on it.
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
    piece = run_numbers(starts)
    chosen = blunt[piece] & (side[tail] == np.where(upper, 1, -1)[piece])
    return np.unique(tail[chosen])


def _insert_crossings(
    pieces: Pieces, plane: CutPlane, offset: Floats, side: NDArray[np.int8], hit: Bools
) -> tuple[Pieces, Floats]:
    """Insert vertices on the crossed edges of the hit pieces, in all pieces with these edges.

    Also returns the signed distance of all vertices from the plane, 0 for those on it.
    """
    corners, owner = pieces.corners, pieces.owner
    heads = corners[next_corners(pieces.starts)]
    crosses = side[corners] * side[heads] < 0
    count = len(pieces.vertices)
    asked = np.flatnonzero(crosses & hit[owner])
    cut, first = np.unique(pieces.edges[asked], return_index=True)
    low, high = np.sort(np.stack([corners, heads])[:, asked[first]], axis=0)
    # Ordered by their vertices, so that the order does not depend on the numbers of edges.
    order = np.lexsort([cut, high, low])
    cut, low, high = cut[order], low[order], high[order]
    # Measured from the end with the lower number: all polygons get the same point.
    share = (offset[low] / (offset[low] - offset[high]))[:, None, None]
    made = pieces.vertices[low] + share * (pieces.vertices[high] - pieces.vertices[low])
    made[:, plane.volume, plane.axis] = plane.value

    # There are none where the plane passes through two corners that lie on it.
    number = np.full(pieces.edge_count, -1, dtype=np.int64)
    number[cut] = np.arange(len(cut))
    where = np.flatnonzero(number[pieces.edges] >= 0)
    made_by = number[pieces.edges[where]]
    # The half at the end with the lower number keeps the number of the edge.
    near, far = pieces.edges[where], len(number) + made_by
    rises = corners[where] < heads[where]
    edges = pieces.edges.copy()
    edges[where] = np.where(rises, near, far)
    added = np.bincount(owner[where], minlength=pieces.count)
    grown = Pieces(
        vertices=np.concatenate([pieces.vertices, made]),
        corners=np.insert(corners, where + 1, count + made_by),
        edges=np.insert(edges, where + 1, np.where(rises, far, near)),
        starts=pieces.starts + run_starts(added),
        triangle=pieces.triangle,
    )
    distance = np.where(side == 0, 0.0, offset)
    return grown, np.concatenate([distance, np.zeros(len(cut))])


def _separate(pieces: Pieces, hit: Bools, distance: Floats, dent: float) -> Pieces:
    """Separate the hit pieces along the chord between the ends of their upper run of corners.

    Parameters
    ----------
    distance : (V,) float64
        Signed distance of each vertex from the plane, 0 for those on it.
    dent : float
        Depth of dents that earlier cuts may have left.
    """
    lengths = np.diff(pieces.starts)
    which = np.flatnonzero(hit)
    begin, length = _upper_runs(pieces, which, distance, dent)
    size = lengths[which]
    # The upper part is the run and the vertices on the plane at both ends; the lower is the rest.
    first = pieces.starts[which]
    upper = _cyclic_runs(first, size, begin - 1, length + 2)
    lower = _cyclic_runs(first, size, begin + length, size - length)

    new_lengths = lengths.copy()
    new_lengths[which] = size - length
    starts = run_starts(np.concatenate([new_lengths, length + 2]))
    total_low = int(starts[pieces.count])
    # Old index of each corner, in the new order; both parts end where the chord begins.
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
    """First corner above the plane in each hit piece (m,), and the length of its run of corners.

    A convex polygon has one run above the plane. Corners that earlier cuts took as lying on their
    planes may dent it, so the run that reaches furthest is taken; the others must be dents.

    Raises
    ------
    CheckError
        Another run is higher than a dent: the polygon is not convex.
    """
    starts, size = pieces.starts[which], np.diff(pieces.starts)[which]
    gathered, corner = gather_runs(pieces.starts, which)
    piece, place = run_numbers(gathered), places_in_runs(size)
    height = distance[pieces.corners[corner]]
    above = height > 0
    before = starts[piece] + (place - 1) % size[piece]
    enters = above & (distance[pieces.corners[before]] <= 0)
    # Number the runs in the order of corners; one that wraps round is the last of its piece.
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


def _cyclic_runs(first: Ints, size: Ints, begin: Ints, length: Ints) -> Ints:
    """(p,) indices ``first + (begin, begin + 1, ...) % size`` of runs of the given lengths (m,)."""
    step = np.repeat(begin, length) + places_in_runs(length)
    return np.asarray(np.repeat(first, length) + step % np.repeat(size, length))
