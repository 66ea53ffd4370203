"""Triangles of deformed parts: joined along edges, and measured against surfaces and curves."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.occ.part.mesh import PartTriangles
from ffdcli.part.deform import DeformedPart
from ffdcli.tessellate.deviations import (
    DENSE,
    distances_from_segments,
    distances_from_triangles,
    segment_grid,
    triangle_grid,
)


def measure_triangles(deformed: DeformedPart, made: PartTriangles) -> float:
    """The largest distance found between triangles and the new faces and edges, model length.

    Points are taken on a grid within every triangle, in the parameters of its face, and on the
    piece of an edge between two corners.
    """
    part, worst, grid = deformed.part, 0.0, triangle_grid(DENSE)
    for face, (old, new) in enumerate(zip(part.surfaces, deformed.surfaces, strict=True)):
        surface = old if new is None else new
        corners = made.corners[made.face == face]
        if surface.kind != "plane" and len(corners):
            at = grid @ made.parameters[corners]
            exact = surface.points(at[..., 0], at[..., 1])
            found = distances_from_triangles(exact, made.points[corners])
            worst = max(worst, float(found.max()))
    shares = segment_grid(DENSE)
    for edge, (mine, its) in enumerate(zip(part.curves, deformed.curves, strict=True)):
        curve = mine if its is None else its
        chosen = made.chord_edge == edge
        if curve is not None and curve.kind != "line" and chosen.any():
            exact = curve.points(made.chord_ends[chosen] @ shares.T)
            ends = made.points[made.chords[chosen]]
            worst = max(worst, float(distances_from_segments(exact, *ends.swapaxes(0, 1)).max()))
    return worst


def join_triangles(shell: Ints, made: PartTriangles) -> tuple[Ints, Ints, Ints]:
    """Triangles whose faces share the points on common edges.

    Neighbouring faces of a shell have equal points there.

    Parameters
    ----------
    shell : (F,) int64
        Shell of each face.
    made : PartTriangles

    Returns
    -------
    (V,) int64
        A point of each vertex.
    (T, 3) int64
        Vertices of the triangles; those without area that stand at the pole of a face are left out.
    (T,) int64
        Their faces.
    """
    of = np.zeros(len(made.points), dtype=np.int64)
    of[made.corners] = shell[made.face][:, None]
    keys = np.column_stack([of.astype(np.float64), made.points])
    _, chosen, where = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    corners = where.reshape(-1)[made.corners]
    wide = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return chosen, corners[wide], made.face[wide]


def points_at_rest(deformed: DeformedPart, made: PartTriangles) -> Floats:
    """(n, 3) the points of triangles on the part as it was read, at the same parameters."""
    rest = np.empty_like(made.points)
    pairs = zip(deformed.part.surfaces, deformed.planes, strict=True)
    for face, (surface, plane) in enumerate(pairs):
        own = np.unique(made.corners[made.face == face])
        rest[own] = (plane or surface).points(*made.parameters[own].T)
    return rest
