"""Triangulate the undeformed faces of a B-rep on their outlines.

Undeformed faces are planar polygons. The triangles of two faces share the edges between them by
number.
"""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Brep
from ffdcli.corners import edge_keys, next_corners
from ffdcli.errors import CheckError
from ffdcli.mesh.polygons import area_vectors, doubled_areas, plane_coordinates
from ffdcli.mesh.triangle_net import TriangleNet

# Rounding allowed between the areas of a face and its triangles, as a share of its bounding box.
_AREA_SLACK = 1e-9


def net_of_faces(brep: Brep, rest: Floats) -> TriangleNet:
    """Triangulate all faces of a B-rep with undeformed vertices (V, 3), model length.

    Vertices and edges of the B-rep come first; the owner of a triangle is its face.

    Raises
    ------
    CheckError
        An outline crosses itself.
    """
    starts = brep.loop_coedges[brep.face_loops]
    tails = np.where(
        brep.coedge_forward, brep.edges[brep.coedge_edge, 0], brep.edges[brep.coedge_edge, 1]
    )
    following = next_corners(brep.loop_coedges)
    counts = np.diff(starts)
    simple = np.flatnonzero(counts == 3)
    pieces, owners = [starts[simple][:, None] + np.arange(3)], [simple]
    # Holes have negative area: the sum over the loops is the area of the face.
    normals = area_vectors(rest, tails, brep.loop_coedges)
    normals = np.add.reduceat(normals, brep.face_loops[:-1], axis=0)
    for face in np.flatnonzero(counts != 3).tolist():
        loops = brep.loop_coedges[brep.face_loops[face] : brep.face_loops[face + 1] + 1]
        first, last = int(loops[0]), int(loops[-1])
        points = plane_coordinates(rest[tails[first:last]], normals[face])
        after = following[first:last] - first
        triangles = _triangulate(points, loops[1:] - first, after)
        _require_covered(points, after, triangles, rest[tails[first]])
        pieces.append(first + triangles)
        owners.append(np.full(len(triangles), face))
    corners, owner = np.concatenate(pieces), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    corners, owner = corners[order], owner[order]

    # On an outline a side is an edge of the B-rep; within the face two sides share a new edge.
    heads = np.roll(corners, -1, axis=1)
    sides = brep.coedge_edge[corners]
    within = following[corners] != heads
    keys = edge_keys(corners[within], heads[within], len(tails))
    known, number = np.unique(keys, return_inverse=True)
    sides[within] = len(brep.edges) + number
    chords = tails[np.column_stack(np.divmod(known, len(tails)))]
    return TriangleNet(rest, tails[corners], sides, np.concatenate([brep.edges, chords]), owner)


def _triangulate(points: Floats, ends: Ints, following: Ints) -> Ints:
    """Triangles (m, 3) that cover an outline with holes, the outer loop first, on all corners."""
    ears = mapbox_earcut.triangulate_float64(points, ends.astype(np.uint32))
    triangles = np.asarray(ears, dtype=np.int64).reshape(-1, 3)
    if len(triangles) == len(points) + 2 * len(ends) - 4:
        return triangles
    return _restore_straight_corners(triangles, following)


def _restore_straight_corners(triangles: Ints, following: Ints) -> Ints:
    """Insert the corners on straight sections of the outline, which ear clipping omits.

    A triangle beside such a section becomes a fan around its opposite corner.
    """
    after = following.tolist()
    todo = [tuple(row) for row in triangles.tolist()]
    directed = {(t[i], t[(i + 1) % 3]) for t in todo for i in range(3)}
    done: list[tuple[int, int, int]] = []
    # Each step inserts one corner.
    left = len(after)
    while todo and left >= 0:
        triangle = todo.pop()
        for i in range(3):
            tail, head, far = triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]
            if after[tail] != head and (head, tail) not in directed:
                between = after[tail]
                todo += [(tail, between, far), (between, head, far)]
                directed |= {(tail, between), (between, far), (far, between)}
                left -= 1
                break
        else:
            done.append(triangle)
    return np.array(done, dtype=np.int64).reshape(-1, 3)


def _require_covered(points: Floats, following: Ints, triangles: Ints, place: Floats) -> None:
    """Raise an error if triangles do not cover their outline once, with all its corners."""
    arms = points - points[0]
    area = doubled_areas(arms[:1], arms, arms[following]).sum()
    covered = np.abs(doubled_areas(*(arms[triangles[:, i]] for i in range(3)))).sum()
    used = np.bincount(triangles.ravel(), minlength=len(points))
    slack = _AREA_SLACK * float(np.prod(np.ptp(points, axis=0)))
    if used.min(initial=1) == 0 or abs(area - covered) > slack:
        where = ", ".join(f"{value:.6g}" for value in place)
        raise CheckError(
            f"the outline of a face near ({where}) before deformation crosses or touches itself",
            hint="write a CAD file, or use --mesh-mode adaptive",
        )
