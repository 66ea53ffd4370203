"""Outlines of regions: shared edges and closed loops, in integers.

Edges between pieces of one region cancel in pairs, which leaves the outline. Vertices between two
collinear edges of the same two regions are removed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, gather_runs, run_numbers, run_starts
from ffdcli.corners import edge_keys, find_twins, next_corners
from ffdcli.errors import MeshError
from ffdcli.graphs import connected_components
from ffdcli.surface.cut import Pieces
from ffdcli.surface.partition import Partition


@dataclass(frozen=True)
class Outlines:
    """Regions bounded by shared straight edges.

    Parameters
    ----------
    edges : (E, 2) int64
        Vertices of the cut mesh at both ends.
    edge_regions : (E, 2) int64
        Regions left and right of the edge, seen from outside; -1 for none.
    coedge_edge : (C,) int64
    coedge_forward : (C,) bool
    loop_coedges : (L + 1,) int64
        Loop ``l`` is the chain ``loop_coedges[l]:loop_coedges[l + 1]`` of coedges.
    region_loops : (R + 1,) int64
        Loops of each region, the outer one first.
    straightened : float, model length
        Largest distance of a removed vertex from its straight edge.
    """

    edges: Ints
    edge_regions: Ints
    coedge_edge: Ints
    coedge_forward: Bools
    loop_coedges: Ints
    region_loops: Ints
    straightened: float

    @property
    def coedge_region(self) -> Ints:
        """(C,) region of each coedge."""
        return run_numbers(self.region_loops)[run_numbers(self.loop_coedges)]


def trace_outlines(parts: Partition) -> Outlines:
    """Outlines of all regions; vertices within epsilon of straight edges are removed.

    Loops turn counter-clockwise in the coordinates along the axes ``b, c`` of their region.

    Raises
    ------
    MeshError
        An outline is not closed, or has no corner.
    """
    pieces, epsilon = parts.pieces, parts.facets.tolerances.epsilon
    tails = pieces.corners
    heads = tails[next_corners(pieces.starts)]
    region = parts.region[pieces.owner]
    twins = find_twins(pieces.edges, tails)
    interior = (twins >= 0) & (region[twins] == region)
    outer = np.flatnonzero(~interior)
    edges, sides = _shared_edges(pieces, heads, region, outer, twins[outer] >= 0)
    edges, sides, straightened = _straighten(pieces.vertices[:, 0], edges, sides, epsilon)
    return _loops(parts, edges, sides, straightened)


def _shared_edges(
    pieces: Pieces, heads: Ints, region: Ints, outer: Ints, paired: Bools
) -> tuple[Ints, Ints]:
    """Edges (E, 2) of the outer sides and the regions (E, 2) beside them, unpaired edges last.

    They are ordered by their vertices, which does not depend on the numbers of edges.
    """
    tails, heads, region = pieces.corners[outer], heads[outer], region[outer]
    keys = edge_keys(tails, heads, len(pieces.vertices))
    order = np.lexsort([tails > heads, pieces.edges[outer], keys])
    order = order[paired[order]]
    left, right = order[0::2], order[1::2]
    alone = np.flatnonzero(~paired)
    edges = np.concatenate(
        [np.column_stack([tails[left], heads[left]]), np.column_stack([tails[alone], heads[alone]])]
    )
    sides = np.concatenate(
        [
            np.column_stack([region[left], region[right]]),
            np.column_stack([region[alone], np.full(len(alone), -1)]),
        ]
    )
    return edges, sides


def _straighten(
    vertices: Floats, edges: Ints, sides: Ints, epsilon: float
) -> tuple[Ints, Ints, float]:
    """Replace chains of collinear edges between the same two regions by single edges.

    Regions that two edges alone would then bound keep all their vertices: they are needles.
    """
    movable = _passable(vertices, edges, sides, epsilon)
    while True:
        found, beside, worst = _straighten_at(movable, vertices, edges, sides, epsilon)
        used, uses = np.unique(beside[beside >= 0], return_counts=True)
        held = edges[np.isin(sides, used[uses < 3]).any(axis=1)]
        if not movable[held].any():
            return found, beside, worst
        movable[held] = False


def _straighten_at(
    movable: Bools, vertices: Floats, edges: Ints, sides: Ints, epsilon: float
) -> tuple[Ints, Ints, float]:
    """Replace chains at movable vertices (V,); those of them that lie off a chord cease to be."""
    worst = 0.0
    while True:
        chains = _chains(edges, movable, len(vertices))
        ends = chains.ends
        start, direction = vertices[ends[:, 0]], vertices[ends[:, 1]] - vertices[ends[:, 0]]
        length = np.linalg.norm(direction, axis=1)
        inner = np.flatnonzero(movable)
        chain = chains.of_vertex[inner]
        usable = length > 0
        unit = direction / np.where(usable, length, 1.0)[:, None]
        along = vertices[inner] - start[chain]
        place = np.einsum("ij,ij->i", along, unit[chain])
        off = np.linalg.norm(along - place[:, None] * unit[chain], axis=1)
        off = np.where(usable[chain], off, np.inf)
        if not np.any(off > epsilon):
            worst = float(off.max(initial=0.0))
            break
        # A chain that is not straight is divided at its furthest vertex.
        furthest = np.lexsort([-off, chain])
        furthest = furthest[np.r_[True, chain[furthest][1:] != chain[furthest][:-1]]]
        keep = furthest[off[furthest] > epsilon]
        movable[inner[keep]] = False
    return np.where(chains.forward[:, None], ends, ends[:, ::-1]), sides[chains.lead], worst


def _passable(vertices: Floats, edges: Ints, sides: Ints, epsilon: float) -> Bools:
    """(V,) True for vertices with exactly two edges, collinear and between the same two regions."""
    count = len(vertices)
    ends = edges.T.ravel()
    degree = np.bincount(ends, minlength=count)
    order = np.argsort(ends, kind="stable")
    position = run_starts(degree)
    two = np.flatnonzero(degree == 2)
    first, second = order[position[two]], order[position[two] + 1]
    e, f = first % len(edges), second % len(edges)
    same = np.all(np.sort(sides[e], axis=1) == np.sort(sides[f], axis=1), axis=1)
    far_e = edges[e, np.where(first < len(edges), 1, 0)]
    far_f = edges[f, np.where(second < len(edges), 1, 0)]
    chord = vertices[far_f] - vertices[far_e]
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.where(length > 0, length, 1.0)[:, None]
    along = vertices[two] - vertices[far_e]
    place = np.einsum("ij,ij->i", along, unit)
    off = np.linalg.norm(along - place[:, None] * unit, axis=1)
    straight = (off <= epsilon) & (place > 0) & (place < length)
    result = np.zeros(count, dtype=bool)
    result[two[same & straight]] = True
    return result


@dataclass(frozen=True)
class _Chains:
    """Chains of edges joined at movable vertices.

    Parameters
    ----------
    ends : (K, 2) int64
        Vertices at both ends.
    lead : (K,) int64
        The edge at the first end.
    forward : (K,) bool
        True where that edge runs away from the first end.
    of_vertex : (V,) int64
        A chain that touches each vertex; the only one, for movable vertices.
    """

    ends: Ints
    lead: Ints
    forward: Bools
    of_vertex: Ints


def _chains(edges: Ints, movable: Bools, vertex_count: int) -> _Chains:
    """Chain edges at movable vertices (V,).

    Raises
    ------
    MeshError
        A chain is closed.
    """
    count = len(edges)
    ends = edges.T.ravel()
    number = np.tile(np.arange(count), 2)
    at = np.flatnonzero(movable[ends])
    order = at[np.argsort(ends[at], kind="stable")]
    pair = number[order].reshape(-1, 2)
    chain = connected_components(count, *pair.T)
    total = int(chain.max(initial=-1)) + 1
    of_vertex = np.full(vertex_count, -1, dtype=np.int64)
    of_vertex[ends] = chain[number]
    fixed = np.flatnonzero(~movable[ends])
    order = fixed[np.argsort(chain[number[fixed]], kind="stable")]
    labels = chain[number[order]]
    if len(order) != 2 * total or not np.array_equal(labels, np.repeat(np.arange(total), 2)):
        raise MeshError("an outline closes on itself without a corner")
    stops = ends[order].reshape(-1, 2)
    lead = number[order].reshape(-1, 2)[:, 0]
    return _Chains(stops, lead, edges[lead, 0] == stops[:, 0], of_vertex)


def _loops(parts: Partition, edges: Ints, sides: Ints, straightened: float) -> Outlines:
    """Chain the coedges of every region into closed loops, outer loop first."""
    count = len(edges)
    right = np.flatnonzero(sides[:, 1] >= 0)
    coedge_edge = np.concatenate([np.arange(count), right])
    forward = np.concatenate([np.ones(count, dtype=bool), np.zeros(len(right), dtype=bool)])
    region = np.concatenate([sides[:, 0], sides[right, 1]])
    tail = np.concatenate([edges[:, 0], edges[right, 1]])
    head = np.concatenate([edges[:, 1], edges[right, 0]])
    following = _follow(parts, tail, head, region)
    order, starts = _cycles(following)
    loop_region = region[order[starts[:-1]]]
    area = _signed_area(parts, tail[order], region[order], starts)
    loop_coedges, index = gather_runs(starts, np.lexsort([-area, loop_region]))
    order = order[index]
    per_region = np.bincount(loop_region, minlength=len(parts.patch))
    return Outlines(
        edges=edges,
        edge_regions=sides,
        coedge_edge=coedge_edge[order],
        coedge_forward=forward[order],
        loop_coedges=loop_coedges,
        region_loops=run_starts(per_region),
        straightened=straightened,
    )


def _follow(parts: Partition, tail: Ints, head: Ints, region: Ints) -> Ints:
    """(C,) coedge that follows each coedge round its loop: the only one that leaves its head."""
    span = np.int64(len(parts.pieces.vertices))
    leaving = region * span + tail
    order = np.argsort(leaving, kind="stable")
    ranked = leaving[order]
    arriving = region * span + head
    place = np.searchsorted(ranked, arriving)
    if not np.array_equal(ranked[np.minimum(place, len(ranked) - 1)], arriving):
        raise MeshError("an outline is not closed")
    return order[place]


def _cycles(following: Ints) -> tuple[Ints, Ints]:
    """Cycles of a permutation: their members in order, and the starts of the cycles."""
    count = len(following)
    label = connected_components(count, np.arange(count), following)
    length = np.bincount(label)
    total, starts = len(length), run_starts(length)
    current = np.full(total, count, dtype=np.int64)
    np.minimum.at(current, label, np.arange(count))
    order = np.empty(count, dtype=np.int64)
    active = np.arange(total)
    for step in range(int(length.max(initial=0))):
        active = active[length[active] > step]
        order[starts[active] + step] = current[active]
        current[active] = following[current[active]]
    return order, starts


def _signed_area(parts: Partition, corner: Ints, region: Ints, starts: Ints) -> Floats:
    """(L,) area that each loop of corners (C,) encloses, positive counter-clockwise."""
    loop, after = run_numbers(starts), next_corners(starts)
    places = parts.local(corner, parts.patch[region])[:, 1:]
    p, q = (places - places[starts[:-1]][loop]).T
    share = (p * q[after] - p[after] * q) / 2
    return np.bincount(loop, weights=share, minlength=len(starts) - 1).astype(np.float64)
