"""The bodies of a mesh: volume, closedness, and which is a cavity of which."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh.edges import EdgeUses, find_edges, label_bodies
from ffdcli.mesh.polygons import area_vectors, triangles
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.winding import winding_numbers


@dataclass(frozen=True)
class ShellNesting:
    """Edge-connected bodies and how they lie in one another.

    Parameters
    ----------
    body : (P,) int64
        Body of each polygon.
    volume : (B,) float64, model length cubed
        Signed: negative where the polygons face inwards. Means nothing for an open body.
    closed : (B,) bool
        Every edge used exactly twice, in opposite senses.
    parent : (B,) int64
        For a cavity (closed, facing inwards, inside the material of others) the closest
        outward-facing body around it; -1 for all others.
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
        """Closed bodies that face inwards and are no cavity."""
        return np.flatnonzero(self.closed & (self.volume < 0) & (self.parent < 0))


def shells(mesh: Mesh, edges: EdgeUses | None = None, *, nested: bool = True) -> ShellNesting:
    """Tell the bodies of a mesh apart and, where `nested` is asked for, find the cavities.

    A vertex lies inside a closed body where the body's polygons wind round it.
    """
    edges = find_edges(mesh) if edges is None else edges
    count, body = label_bodies(mesh, edges)
    body_of_corner = np.repeat(body, np.diff(mesh.starts))
    sound = (edges.uses == 2) & (edges.forward == 1)
    loose = np.bincount(body_of_corner[~sound[edges.edge_of_corner]], minlength=count)
    points = mesh.vertices[mesh.corners]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, body_of_corner, points)
    np.maximum.at(high, body_of_corner, points)
    # Cones from the middle of each body's own box: no digits lost for bodies far from the origin.
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


def _find_parents(mesh: Mesh, body: Ints, volume: Floats, closed: Bools, boxes: Floats) -> Ints:
    parent = np.full(len(volume), -1, dtype=np.int64)
    inward = np.flatnonzero(closed & (volume < 0))
    if not len(inward) or not np.any(closed & (volume > 0)):
        return parent
    triangle, polygon = triangles(mesh)
    order = np.argsort(body[polygon], kind="stable")
    bounds = np.searchsorted(body[polygon][order], np.arange(len(volume) + 1))
    of_body = [triangle[order[a:b]] for a, b in pairwise(bounds)]
    for inner in inward.tolist():
        around = closed & np.all(boxes[0] <= boxes[0, inner], axis=1)
        around &= np.all(boxes[1] >= boxes[1, inner], axis=1)
        around[inner] = False
        turns = np.zeros(len(volume), dtype=np.int64)
        for outer in np.flatnonzero(around).tolist():
            # A vertex the two share would lie on the outer body, neither inside nor outside.
            own = np.setdiff1d(of_body[inner], of_body[outer])
            if len(own):
                corners = mesh.vertices[of_body[outer]]
                turns[outer] = round(winding_numbers(mesh.vertices[own[:1]], corners)[0])
        enclosing = np.flatnonzero(turns > 0)
        # In the void of another cavity the turns cancel: there is no material to be hollow.
        if len(enclosing) and turns.sum() > 0:
            parent[inner] = enclosing[np.argmin(volume[enclosing])]
    return parent
