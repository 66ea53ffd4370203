"""Plain geometry of polygons: area vectors, flatness, and triangles without new vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffdcli.corners import next_corners
from ffdcli.errors import MeshError
from ffdcli.mesh.record import Floats, Ints, Mesh

Bools = NDArray[np.bool_]


def area_vectors(vertices: Floats, corners: Ints, starts: Ints) -> Floats:
    """Area of every polygon times its unit normal, by Newell's sum.

    Exact in the mean for polygons that are not flat, and right for concave ones. Coordinates are
    taken from each polygon's first corner, so far-away models lose no digits.

    Returns
    -------
    (P, 3) float64, model length squared
    """
    points = vertices[corners]
    spokes = points - np.repeat(points[starts[:-1]], np.diff(starts), axis=0)
    turns = np.cross(spokes, spokes[next_corners(starts)])
    return np.asarray(np.add.reduceat(turns, starts[:-1], axis=0) / 2)


def repeats_a_vertex(corners: Ints, starts: Ints) -> Bools:
    """(P,) whether a polygon passes through one of its vertices more than once."""
    polygon = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    order = np.lexsort((corners, polygon))
    same = np.diff(corners[order]) == 0
    same &= np.diff(polygon) == 0
    repeated = np.zeros(len(starts) - 1, dtype=bool)
    repeated[polygon[1:][same]] = True
    return repeated


def triangles(mesh: Mesh) -> tuple[Ints, Ints]:
    """Every polygon as triangles on its own vertices, concave ones included.

    Returns
    -------
    corners : (T, 3) int64
        Vertices of each triangle, the way round of its polygon, in the order of the polygons.
    polygon : (T,) int64
        The polygon each triangle is part of.

    Raises
    ------
    MeshError
        A polygon of more than four corners that crosses or touches itself.
    """
    return triangulate(mesh.vertices, mesh.corners, mesh.starts, mesh.source)


def triangulate(
    vertices: Floats, corners: Ints, starts: Ints, source: str = "mesh"
) -> tuple[Ints, Ints]:
    """As `triangles`, on bare arrays."""
    counts = np.diff(starts)
    (three,), (four,), (more,) = (np.nonzero(c) for c in (counts == 3, counts == 4, counts > 4))
    quads = _split_quads(vertices, corners[starts[four][:, None] + np.arange(4)])
    pieces = [corners[starts[three][:, None] + np.arange(3)], quads.reshape(-1, 3)]
    owners = [three, np.repeat(four, 2)]
    normals = area_vectors(vertices, corners, starts) if len(more) else vertices[:0]
    for polygon in more.tolist():
        loop = corners[starts[polygon] : starts[polygon + 1]]
        clipped = _clip_ears(vertices[loop], normals[polygon])
        if len(clipped) != len(loop) - 2:
            raise MeshError(
                f"polygon {polygon} (counted from 0, {len(loop)} corners) near "
                f"{place_text(vertices[loop[0]])} crosses or touches itself",
                file=source,
                hint="split it into triangles in a mesh editor and export again",
            )
        pieces.append(loop[clipped])
        owners.append(np.full(len(clipped), polygon))
    owner = np.concatenate(owners).astype(np.int64)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order]


def split_bent(
    vertices: Floats, corners: Ints, starts: Ints, delta: float, source: str
) -> tuple[Ints, Ints, Ints]:
    """Split the polygons that are not flat within `delta` (model length) into triangles.

    Quads go along the shorter diagonal, larger ones by ear clipping. Polygons that repeat a
    vertex or enclose no area stay as they are, to be reported as such.

    Returns
    -------
    corners, starts : (C,) and (P + 1,) int64
        The polygons, in the old order, triangles in the place of the polygon they came from.
    origin : (P',) int64
        The polygon that each one was, or was part of.
    """
    counts = np.diff(starts)
    if not np.any(counts > 3):
        return corners, starts, np.arange(len(counts))
    normals = area_vectors(vertices, corners, starts)
    lengths = np.linalg.norm(normals, axis=1)
    polygon = np.repeat(np.arange(len(counts)), counts)
    points = vertices[corners]
    centres = np.add.reduceat(points, starts[:-1], axis=0) / counts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = normals / lengths[:, None]
    height = np.abs(np.einsum("ij,ij->i", points - centres[polygon], unit[polygon]))
    deviation = np.maximum.reduceat(height, starts[:-1])
    # The comparison is False where there is no normal to measure along.
    bent = (counts > 3) & (deviation > delta) & ~repeats_a_vertex(corners, starts)
    if not bent.any():
        return corners, starts, np.arange(len(counts))

    taken = bent[polygon]
    bent_starts = np.concatenate([[0], np.cumsum(counts[bent])])
    split, owner = triangulate(vertices, corners[taken], bent_starts, source)
    kept = np.flatnonzero(~bent)
    origin = np.flatnonzero(bent)[owner]
    new_counts = np.concatenate([counts[kept], np.full(len(split), 3)])
    source_polygon = np.concatenate([kept, origin])
    in_order = np.argsort(source_polygon, kind="stable")
    new_starts = np.concatenate([[0], np.cumsum(new_counts[in_order])]).astype(np.int64)
    new_corners = np.concatenate([corners[~taken], split.ravel()])
    corner_order = np.argsort(
        np.concatenate([polygon[~taken], np.repeat(origin, 3)]), kind="stable"
    )
    return new_corners[corner_order], new_starts, source_polygon[in_order]


def place_text(point: Floats) -> str:
    """Coordinates for a message."""
    return "(" + ", ".join(f"{x:.9g}" for x in point) + ")"


def _split_quads(vertices: Floats, quads: Ints) -> Ints:
    """(Q, 2, 3) triangles of (Q, 4) quads: the shorter diagonal, if it lies inside the quad."""
    halves = np.stack([quads[:, [0, 1, 2, 0, 2, 3]], quads[:, [1, 2, 3, 1, 3, 0]]])
    corners = vertices[halves.reshape(2, -1, 2, 3)]
    first = corners[..., 0, :]
    turns = np.cross(corners[..., 1, :] - first, corners[..., 2, :] - first)
    normal = turns.sum(axis=(0, 2))
    inside = np.all(np.einsum("dqti,qi->dqt", turns, normal) > 0, axis=2)
    across = vertices[quads[:, [0, 1]]] - vertices[quads[:, [2, 3]]]
    length = np.einsum("qdi,qdi->dq", across, across)
    second = np.where(inside[0] == inside[1], length[1] < length[0], inside[1])
    chosen: Ints = np.where(second[:, None], halves[1], halves[0])
    return chosen.reshape(-1, 2, 3)


def _clip_ears(points: Floats, normal: Floats) -> Ints:
    """(n - 2, 3) corners of the ears of one polygon; fewer or none where it crosses itself."""
    import mapbox_earcut

    # Dropping the dominant axis keeps the coordinates as they are, so what is collinear stays so.
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    if normal[axis] < 0:
        kept.reverse()
    flat = np.ascontiguousarray(points[:, kept])
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32))
    clipped = np.asarray(ears, dtype=np.int64).reshape(-1, 3)
    a, b, c = (flat[clipped[:, n]] for n in range(3))
    covered = ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])).sum()
    covered -= ((b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])).sum()
    # Ears of a crossing outline overlap or leave gaps; the slack is for rounding only.
    slack = 1e-9 * float(np.prod(np.ptp(flat, axis=0)))
    return clipped if abs(covered / 2 - abs(normal[axis])) <= slack else clipped[:0]
