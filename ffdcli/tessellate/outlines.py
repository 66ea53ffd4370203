"""Triangulate the undeformed faces of a B-rep on their outlines.

Undeformed faces are planar polygons. The triangles of two faces share the edges between them by
number.
"""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Brep
from ffdcli.corners import edge_keys
from ffdcli.errors import CheckError
from ffdcli.mesh.polygons import area_vectors
from ffdcli.mesh.triangle_net import TriangleNet

# Rounding allowed between the areas of a face and its triangles, as a share of its bounding box.
_AREA_SLACK = 1e-9


def net_of_faces(brep: Brep, rest: Floats) -> TriangleNet:
    """Triangulate all faces on the vertices of their outlines.

    Parameters
    ----------
    brep : Brep
    rest : (V, 3) float64, model length
        Undeformed vertices of the B-rep.

    Returns
    -------
    TriangleNet
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
    following = np.arange(1, len(tails) + 1)
    following[brep.loop_coedges[1:] - 1] = brep.loop_coedges[:-1]
    counts = np.diff(starts)
    simple = np.flatnonzero(counts == 3)
    pieces, owners = [starts[simple][:, None] + np.arange(3)], [simple]
    # Holes have negative area: the sum over the loops is the area of the face.
    normals = area_vectors(rest, tails, brep.loop_coedges)
    normals = np.add.reduceat(normals, brep.face_loops[:-1], axis=0)
    for face in np.flatnonzero(counts != 3).tolist():
        loops = brep.loop_coedges[brep.face_loops[face] : brep.face_loops[face + 1] + 1]
        first, last = int(loops[0]), int(loops[-1])
        points = _flatten(rest[tails[first:last]], normals[face])
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


def _flatten(points: Floats, normal: Floats) -> Floats:
    """Drop the dominant axis of the normal: exact plane coordinates, counter-clockwise."""
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    if normal[axis] < 0:
        kept.reverse()
    return np.ascontiguousarray(points[:, kept])


def _triangulate(points: Floats, ends: Ints, following: Ints) -> Ints:
    """Triangles (n, 3) that cover an outline with holes and use all its corners.

    Parameters
    ----------
    points : (n, 2) float64
        Corners, loop after loop, the outer one first.
    ends : (loops,) int64
        End of each loop in the list of corners.
    following : (n,) int64
        Next corner of each corner.
    """
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
    area = _cross(arms, arms[following]).sum()
    a, b, c = (arms[triangles[:, i]] for i in range(3))
    covered = np.abs(_cross(b - a, c - a)).sum()
    used = np.bincount(triangles.ravel(), minlength=len(points))
    slack = _AREA_SLACK * float(np.prod(np.ptp(points, axis=0)))
    if used.min(initial=1) == 0 or abs(area - covered) > slack:
        where = ", ".join(f"{value:.6g}" for value in place)
        raise CheckError(
            f"the outline of a face near ({where}) before deformation crosses or touches itself",
            hint="write a CAD file, or use --mesh-mode adaptive",
        )


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
