"""Tolerances of the edges and vertices of a deformed part."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.new_geometry import UNCHANGED, Made
from ffdcli.part.reach import Reached
from ffdcli.part.record import Part

# Samples along an edge for the stretch of the deformation.
_STRETCH = 9


def new_tolerances(
    part: Part, vertices: Reached, edges: Made, faces: Made
) -> tuple[Floats, Floats]:
    """Tolerances of edges and of vertices.

    An edge's: as it was read times the stretch there, its curve's bound, and the largest bound of
    its faces. A vertex's: the same of the vertex, and no less than its edges'. None falls below
    what was read.
    """
    beside = np.zeros(len(part.curves))
    np.maximum.at(beside, part.coedge_edge, faces.bounds[part.face_of_coedge])
    edge_tolerance = part.edge_tolerance * _edge_stretch(part, edges) + edges.bounds + beside
    slopes = vertices.stretch(part.points, np.arange(len(part.points)))
    own = part.vertex_tolerance * np.where(vertices.identity, 1.0, np.maximum(slopes, 1.0))
    around = np.zeros(len(own))
    most = np.zeros(len(own))
    for end in part.edges.T:
        known = end >= 0
        np.maximum.at(around, end[known], (edges.bounds + beside)[known])
        np.maximum.at(most, end[known], edge_tolerance[known])
    return edge_tolerance, np.maximum(own + around, most)


def _edge_stretch(part: Part, edges: Made) -> Floats:
    """(E,) largest factor by which lengths grow along each edge, 1 at least."""
    out = np.ones(len(part.curves))
    shares = np.linspace(0, 1, _STRETCH)
    moved = [
        edge
        for edge in np.flatnonzero(edges.kinds != UNCHANGED).tolist()
        if part.curves[edge] is not None
    ]
    if moved:
        ends = part.edge_range[moved]
        at = ends[:, :1] + shares * (ends[:, 1:] - ends[:, :1])
        points = [part.curves[edge].points(t) for edge, t in zip(moved, at, strict=True)]  # type: ignore[union-attr]
        found = edges.reached.stretch(np.concatenate(points), np.repeat(moved, _STRETCH))
        out[moved] = np.maximum(found.reshape(-1, _STRETCH).max(axis=1), 1.0)
    return out
