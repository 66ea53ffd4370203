"""Edge-connected bodies of a mesh: volumes, closedness, cavities and overlaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, run_starts
from ffdcli.boxes import meeting_boxes
from ffdcli.mesh.edges import EdgeUses, find_edges, label_bodies
from ffdcli.mesh.polygons import area_vectors, triangles
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.winding import winding_numbers

# Most sample points of a body, and most point-triangle pairs in all.
_MOST_POINTS = 32
_MOST_WORK = 4e6
# A winding number this far from an integer belongs to a point on the surface.
_WHOLE = 0.05


@dataclass(frozen=True)
class ShellNesting:
    """Edge-connected bodies and the cavities among them.

    Parameters
    ----------
    body : (P,) int64
        Body of each polygon.
    volume : (B,) float64, model length cubed
        Signed: negative if the polygons face inwards. Meaningless for an open body.
    closed : (B,) bool
        Every edge is used exactly twice, in opposite senses.
    parent : (B,) int64
        Smallest outward-facing body round a cavity (a closed body that faces inwards, inside the
        material of others); -1 for bodies that are no cavity.
    boxes : (2, B, 3) float64, model length
        Lowest and highest coordinates of each body.
    """

    body: Ints
    volume: Floats
    closed: Bools
    parent: Ints
    boxes: Floats

    @property
    def inside_out(self) -> Ints:
        """(n,) closed bodies that face inwards and are no cavity."""
        return np.flatnonzero(self.closed & (self.volume < 0) & (self.parent < 0))


def shells(mesh: Mesh, edges: EdgeUses | None = None, *, nested: bool = True) -> ShellNesting:
    """The bodies of a mesh, and which of them are cavities.

    Cavities are found, if ``nested``, by winding numbers: the polygons must not cross themselves.
    """
    edges = find_edges(mesh) if edges is None else edges
    count, body = label_bodies(mesh, edges)
    body_of_corner = body[mesh.polygon_of_corner]
    sound = (edges.uses == 2) & (edges.forward == 1)
    loose = np.bincount(body_of_corner[~sound[edges.edge_of_corner]], minlength=count)
    points = mesh.vertices[mesh.corners]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, body_of_corner, points)
    np.maximum.at(high, body_of_corner, points)
    # Cones from the middle of each body's box, so that bodies far from the origin lose no digits.
    middle = (low + high) / 2
    cones = np.einsum(
        "ij,ij->i",
        points[mesh.starts[:-1]] - middle[body],
        area_vectors(mesh.vertices, mesh.corners, mesh.starts),
    )
    volume = np.bincount(body, weights=cones, minlength=count) / 3
    closed = loose == 0
    parent = np.full(count, -1, dtype=np.int64)
    boxes = np.stack([low, high])
    if nested:
        parent = _find_parents(mesh, body, volume, closed, boxes)
    return ShellNesting(body, volume, closed, parent, boxes)


def triangles_by_body(mesh: Mesh, body: Ints, count: int) -> tuple[Ints, Ints]:
    """(T, 3) triangles of all polygons, body after body, and the (count + 1,) starts of bodies."""
    triangle, polygon = triangles(mesh)
    owner = body[polygon]
    return triangle[np.argsort(owner, kind="stable")], run_starts(
        np.bincount(owner, minlength=count)
    )


def _find_parents(mesh: Mesh, body: Ints, volume: Floats, closed: Bools, boxes: Floats) -> Ints:
    parent = np.full(len(volume), -1, dtype=np.int64)
    inward = np.flatnonzero(closed & (volume < 0))
    if not len(inward) or not np.any(closed & (volume > 0)):
        return parent
    triangle, starts = triangles_by_body(mesh, body, len(volume))
    of_body = np.split(triangle, starts[1:-1])
    low, high = boxes
    for inner, near in zip(inward.tolist(), _near(closed, boxes, inward), strict=True):
        around = near[np.all((low[near] <= low[inner]) & (high[near] >= high[inner]), axis=1)]
        turns = np.zeros(len(around), dtype=np.int64)
        for number, outer in enumerate(around.tolist()):
            # A shared vertex lies on the outer body, neither inside nor outside.
            own = np.setdiff1d(of_body[inner], of_body[outer])
            if len(own):
                corners = mesh.vertices[of_body[outer]]
                turns[number] = round(winding_numbers(mesh.vertices[own[:1]], corners)[0])
        enclosing = around[turns > 0]
        # Inside another cavity the winding numbers cancel: there is no material.
        if len(enclosing) and turns.sum() > 0:
            parent[inner] = enclosing[np.argmin(volume[enclosing])]
    return parent


def _near(closed: Bools, boxes: Floats, bodies: Ints) -> list[Ints]:
    """The closed bodies, increasing, whose boxes meet those of some closed bodies."""
    number = np.flatnonzero(closed)
    pairs = number[meeting_boxes(boxes[0, number], boxes[1, number])]
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.lexsort(both.T[::-1])]
    first = np.searchsorted(both[:, 0], bodies)
    last = np.searchsorted(both[:, 0], bodies, side="right")
    ends = zip(first.tolist(), last.tolist(), strict=True)
    return [both[start:end, 1] for start, end in ends]


def find_overlaps(mesh: Mesh, nesting: ShellNesting) -> Floats:
    """(n, 3) points of closed bodies inside the material of others, one for each such body.

    The samples are corners and middles of triangles, limited in number. A body that is found does
    overlap; bodies that cross without a sample point inside the other are missed. The polygons must
    not cross themselves.
    """
    closed = np.flatnonzero(nesting.closed)
    if len(closed) < 2:
        return np.empty((0, 3))
    triangle, bounds = triangles_by_body(mesh, nesting.body, len(nesting.closed))
    corners = mesh.vertices[triangle]
    low, high = nesting.boxes
    limit = int(np.clip(_MOST_WORK / len(corners) / len(closed), 4, _MOST_POINTS))
    found = []
    nears = _near(nesting.closed, nesting.boxes, closed)
    for inner, near in zip(closed.tolist(), nears, strict=True):
        if not len(near):
            continue
        own = corners[bounds[inner] : bounds[inner + 1]]
        points = np.concatenate([np.unique(own.reshape(-1, 3), axis=0), own.mean(axis=1)])
        inside = (points[:, None] > low[near]) & (points[:, None] < high[near])
        points = points[inside.all(axis=2).any(axis=1)]
        points = points[np.linspace(0, len(points) - 1, min(limit, len(points))).astype(int)]
        # The wall of a cavity has winding number 1 in its parent.
        expected = 1.0 if nesting.parent[inner] >= 0 else 0.0
        others = np.concatenate([corners[bounds[n] : bounds[n + 1]] for n in near.tolist()])
        depth = winding_numbers(points, others)
        deep = (np.abs(depth - np.round(depth)) < _WHOLE) & (np.round(depth) > expected)
        found += points[deep][:1].tolist()
    return np.array(found).reshape(-1, 3)
