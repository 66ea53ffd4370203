"""Edge-connected bodies of a mesh: volumes, closedness, and cavities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, run_starts
from ffdcli.mesh.edges import EdgeUses, find_edges, label_bodies
from ffdcli.mesh.polygons import area_vectors, triangles
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.winding import winding_numbers


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

    Parameters
    ----------
    mesh : Mesh
    edges : EdgeUses, optional
        Those of the mesh.
    nested : bool
        Find the cavities, by winding numbers; the polygons must not cross themselves.
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
    for inner in inward.tolist():
        around = closed & np.all(boxes[0] <= boxes[0, inner], axis=1)
        around &= np.all(boxes[1] >= boxes[1, inner], axis=1)
        around[inner] = False
        turns = np.zeros(len(volume), dtype=np.int64)
        for outer in np.flatnonzero(around).tolist():
            # A shared vertex lies on the outer body, neither inside nor outside.
            own = np.setdiff1d(of_body[inner], of_body[outer])
            if len(own):
                corners = mesh.vertices[of_body[outer]]
                turns[outer] = round(winding_numbers(mesh.vertices[own[:1]], corners)[0])
        enclosing = np.flatnonzero(turns > 0)
        # Inside another cavity the winding numbers cancel: there is no material.
        if len(enclosing) and turns.sum() > 0:
            parent[inner] = enclosing[np.argmin(volume[enclosing])]
    return parent
