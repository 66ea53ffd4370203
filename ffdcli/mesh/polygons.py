"""Geometry of polygons: area vectors, triangulation, and splitting of those that are not flat."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, gather_runs, run_numbers, run_starts
from ffdcli.corners import edge_keys, next_corners
from ffdcli.errors import MeshError
from ffdcli.mesh.flip import are_proper, clear_diagonals, flip_to_delaunay
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.triangle_net import net_of_triangles
from ffdcli.messages import counted, place_text


def area_vectors(vertices: Floats, corners: Ints, starts: Ints) -> Floats:
    """(P, 3) area of every polygon times its unit normal, model length squared, by Newell's sum.

    Concave polygons are allowed, and those that are not flat have their mean normal. Coordinates
    are relative to each polygon's first corner, so that models far from the origin lose no digits.
    """
    spokes = from_first_corners(vertices[corners], starts)
    turns = np.cross(spokes, spokes[next_corners(starts)])
    return np.asarray(np.add.reduceat(turns, starts[:-1], axis=0) / 2)


def from_first_corners(points: Floats, starts: Ints) -> Floats:
    """(C, 3) vectors to the corners (C, 3) of polygons from the first corner of each."""
    return np.asarray(points - points[starts[:-1]][run_numbers(starts)])


def repeats_a_vertex(corners: Ints, starts: Ints) -> Bools:
    """(P,) whether a polygon passes through one of its vertices more than once."""
    polygon = run_numbers(starts)
    order = np.lexsort((corners, polygon))
    same = np.diff(corners[order]) == 0
    same &= np.diff(polygon) == 0
    repeated = np.zeros(len(starts) - 1, dtype=bool)
    repeated[polygon[1:][same]] = True
    return repeated


def triangles(mesh: Mesh) -> tuple[Ints, Ints]:
    """Triangles of all polygons, without new vertices; polygons may be concave.

    Returns
    -------
    corners : (T, 3) int64
        Vertices of each triangle, wound like its polygon, in the order of the polygons.
    polygon : (T,) int64
        Polygon of each triangle.

    Raises
    ------
    MeshError
        A polygon crosses itself. One that touches itself is allowed: an outline that runs to its
        hole and back along one edge has an inside.
    """
    corner, polygon = corner_triangles(mesh)
    return mesh.corners[corner], polygon


def corner_triangles(mesh: Mesh) -> tuple[Ints, Ints]:
    """As `triangles`, with positions in ``mesh.corners`` instead of vertices."""
    corner, polygon, crossing = _cut_polygons(mesh.vertices[mesh.corners], mesh.starts)
    if crossing.any():
        first = int(np.argmax(crossing))
        loop = mesh.loop(first)
        raise MeshError(
            f"polygon {first} (counted from 0, {len(loop)} corners) near "
            f"{place_text(mesh.vertices[loop[0]])} crosses itself or doubles back",
            file=mesh.source,
            hint="split it into triangles in a mesh editor and export again",
        )
    return corner, polygon


def triangulate(vertices: Floats, corners: Ints, starts: Ints) -> tuple[Ints, Ints, Bools]:
    """As `triangles`, from arrays; and (P,) whether each polygon crosses itself.

    Crossing quads give any two triangles; larger crossing polygons give none.
    """
    corner, owner, crossing = _cut_polygons(vertices[corners], starts)
    return corners[corner], owner, crossing


def _cut_polygons(points: Floats, starts: Ints) -> tuple[Ints, Ints, Bools]:
    """As `triangulate`, with a point (C, 3) for each corner, and corners instead of vertices."""
    counts = np.diff(starts)
    (three,), (four,), (more,) = (np.nonzero(c) for c in (counts == 3, counts == 4, counts > 4))
    quads, twisted = _split_quads(points, starts[four][:, None] + np.arange(4))
    crossing = np.zeros(len(counts), dtype=bool)
    crossing[four] = twisted
    pieces = [starts[three][:, None] + np.arange(3), quads.reshape(-1, 3)]
    owners = [three, np.repeat(four, 2)]
    every = np.arange(len(points))
    normals = area_vectors(points, every, starts) if len(more) else points[:0]
    for polygon in more.tolist():
        loop = every[starts[polygon] : starts[polygon + 1]]
        clipped = clip_ears(points[loop], normals[polygon])
        crossing[polygon] = not len(clipped)
        pieces.append(loop[clipped])
        owners.append(np.full(len(clipped), polygon))
    owner = np.concatenate(owners).astype(np.int64)
    order = np.argsort(owner, kind="stable")
    corner, owner = np.concatenate(pieces)[order], owner[order]
    large = counts[owner] > 4
    if large.any():
        net = net_of_triangles(_flattened(points, normals, starts), corner[large], owner[large])
        corner[large] = flip_to_delaunay(net)[0].triangles
    return corner, owner, crossing


def _flattened(points: Floats, normals: Floats, starts: Ints) -> Floats:
    """(C, 3) corners projected on planes with the normals (P, 3) of their polygons."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = (normals / np.where(length > 0, length, 1.0))[run_numbers(starts)]
    height = np.einsum("ij,ij->i", from_first_corners(points, starts), unit)
    return np.asarray(points - height[:, None] * unit)


def split_bent(mesh: Mesh) -> Mesh:
    """Split the polygons that are not flat within ``mesh.delta`` into triangles, and note it.

    Quads are split along the shorter diagonal, larger polygons by ear clipping; a diagonal between
    vertices that another edge joins is avoided. The triangles take the place of their polygon.
    Polygons that cross themselves or have no area stay, to be reported as faults.
    """
    vertices, corners, starts = mesh.vertices, mesh.corners, mesh.starts
    counts = np.diff(starts)
    if not np.any(counts > 3):
        return mesh
    normals = area_vectors(vertices, corners, starts)
    lengths = np.linalg.norm(normals, axis=1)
    polygon = mesh.polygon_of_corner
    points = vertices[corners]
    centres = np.add.reduceat(points, starts[:-1], axis=0) / counts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = normals / lengths[:, None]
    height = np.abs(np.einsum("ij,ij->i", points - centres[polygon], unit[polygon]))
    deviation = np.maximum.reduceat(height, starts[:-1])
    # Without a normal the deviation is NaN, and the comparison False.
    bent = (counts > 3) & (deviation > mesh.delta)
    if not bent.any():
        return mesh

    chosen = np.flatnonzero(bent)
    bent_starts, of_bent = gather_runs(starts, chosen)
    split, owner, crossing = _cut_polygons(points[of_bent], bent_starts)
    net = net_of_triangles(points[of_bent], split, owner)
    known = edge_keys(corners, corners[next_corners(starts)], len(vertices))
    net = clear_diagonals(net, normals[chosen[owner]], corners[of_bent], known, len(vertices))
    split = net.triangles
    bent[chosen[crossing & (counts[chosen] > 4)]] = False
    if not bent.any():
        return mesh
    kept = np.flatnonzero(~bent)
    pieces = run_starts(np.concatenate([counts[kept], np.full(len(split), 3)]))
    corner = np.concatenate([gather_runs(starts, kept)[1], of_bent[split.ravel()]])
    origin = np.concatenate([kept, chosen[owner]])
    order = np.argsort(origin, kind="stable")
    new_starts, index = gather_runs(pieces, order)
    corner = corner[index]
    note = (
        counted(int(np.count_nonzero(bent)), "polygon that is", "polygons that are")
        + f" not flat within {mesh.delta:.2g} split into triangles"
    )
    return mesh.rebuilt(vertices, corners[corner], new_starts, origin[order], corner, (note,))


def _split_quads(vertices: Floats, quads: Ints) -> tuple[Ints, Bools]:
    """(Q, 2, 3) triangles of quads (Q, 4), and (Q,) whether each crosses itself or is folded over.

    A quad is split along the shorter of the diagonals that lie inside it, and leave no triangle
    without area if one of them does not.
    """
    halves = np.stack([quads[:, [0, 1, 2, 0, 2, 3]], quads[:, [1, 2, 3, 1, 3, 0]]])
    corners = vertices[halves.reshape(2, -1, 2, 3)]
    first = corners[..., 0, :]
    turns = np.cross(corners[..., 1, :] - first, corners[..., 2, :] - first)
    normal = turns.sum(axis=(0, 2))
    inside = np.all(np.einsum("dqti,qi->dqt", turns, normal) > 0, axis=2)
    proper = are_proper(corners, normal[:, None]).all(axis=2)
    good = np.where(proper.any(axis=0), proper, inside)
    across = vertices[quads[:, [0, 1]]] - vertices[quads[:, [2, 3]]]
    length = np.einsum("qdi,qdi->dq", across, across)
    second = np.where(good[0] == good[1], length[1] < length[0], good[1])
    chosen: Ints = np.where(second[:, None], halves[1], halves[0])
    return chosen.reshape(-1, 2, 3), ~inside.any(axis=0)


def clip_ears(points: Floats, normal: Floats) -> Ints:
    """(n - 2, 3) corners of the ears of a polygon with points (n, 3); (0, 3) if it crosses itself.

    The outline may touch itself: run to a hole and back along one edge, or meet in a point.
    """
    import mapbox_earcut

    flat = plane_coordinates(points, normal)
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32))
    clipped = np.asarray(ears, dtype=np.int64).reshape(-1, 3)
    area = float(np.abs(normal).max())
    if _covers(flat, clipped, area):
        return clipped
    # Earcut leaves out corners in the middle of a straight side, so not all vertices are used.
    clipped = _clip_one_by_one(flat)
    return clipped if _covers(flat, clipped, area) else clipped[:0]


def _covers(flat: Floats, ears: Ints, area: float) -> bool:
    """Whether number and total area of the ears are those of a polygon that does not cross itself.

    The ears of a crossing outline overlap or leave gaps. The slack is for rounding.
    """
    slack = 1e-9 * float(np.prod(np.ptp(flat, axis=0)))
    doubled = doubled_areas(*(flat[ears[:, n]] for n in range(3)))
    sound = len(ears) == len(flat) - 2 and bool(np.all(doubled >= -slack))
    return sound and abs(doubled.sum() / 2 - area) <= slack


def _clip_one_by_one(flat: Floats) -> Ints:
    """(m, 3) ears without other corners in or on them, bluntest first; m < n - 2 on failure."""
    left, ears = np.arange(len(flat)), []
    while len(left) > 2:
        points = flat[left]
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        turn = doubled_areas(before, points, after)
        chord = ((after - before) ** 2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            blunt = np.where(turn > 0, turn / chord, 0.0)
        for tip in np.argsort(-blunt, kind="stable")[: np.count_nonzero(blunt)].tolist():
            a, b, c = before[tip], points[tip], after[tip]
            within = (doubled_areas(a, b, points) >= 0) & (doubled_areas(b, c, points) >= 0)
            within &= doubled_areas(c, a, points) >= 0
            # An outline that touches itself has other corners at the same places.
            own = (points == a).all(axis=1) | (points == b).all(axis=1) | (points == c).all(axis=1)
            if not np.any(within & ~own):
                ears.append([left[tip - 1], left[tip], left[(tip + 1) % len(left)]])
                left = np.delete(left, tip)
                break
        else:
            break
    return np.array(ears, dtype=np.int64).reshape(-1, 3)


def plane_coordinates(points: Floats, normal: Floats) -> Floats:
    """(n, 2) points (n, 3) without the dominant axis of a normal, from whose end they are seen.

    This keeps the coordinates exact: collinear points stay collinear.
    """
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    if normal[axis] < 0:
        kept.reverse()
    return np.ascontiguousarray(points[:, kept])


def doubled_areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """(...) twice the signed area of triangles with corners (..., 2)."""
    first, second = b - a, c - a
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
