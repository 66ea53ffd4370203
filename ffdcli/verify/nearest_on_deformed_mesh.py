"""Nearest points of the deformed mesh to given points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.branch_and_bound import Sheets, search_all
from ffdcli.brep.evaluate.bspline import chunks
from ffdcli.brep.evaluate.nearest import (
    BLOCK,
    HELPED,
    Feet,
    Seeds,
    Solver,
    descend,
    improve,
    nearest,
    unknown,
)
from ffdcli.brep.evaluate.trim import expand
from ffdcli.verify.cut import cut_along
from ffdcli.verify.deformed_mesh import POINTS, DeformedMesh, ModelMap

# Undeformed triangles tried for each point, and pairs of point and triangle per pass; points that
# are compared with the same triangles.
CANDIDATES = 6
PAIRS = 100_000
GROUP = 64
# Largest number of seeds along needles; triangles a foot may cross, at first and at last.
SEEDS = 300_000
BESIDE, WALK = 3, 50
# Share by which pieces are shrunk before they are searched.
_INSET = 1e-12
# Largest degree of a deformation that is interpolated exactly; degree of the others' interpolation.
_MOST_DEGREE = 12
_INTERPOLATED = 6


def distances_to_deformed_mesh(
    image: DeformedMesh,
    seeds: tuple[Ints, Floats, Floats],
    points: Floats,
    settle: float,
    enough: float,
    tolerance: float,
) -> Feet:
    """Nearest points of the deformed mesh to points (n, 3).

    Parameters
    ----------
    seeds : (n,) triangles, (n, 2) parameters, (n, 3) positions
        Known points of the image. Others, inside every triangle, are added.
    settle, enough : float, model length
        As in :class:`ffdcli.brep.evaluate.nearest.Solver`.
    tolerance : float, model length
        Points found farther than this are searched for by bounds.
    """
    triangle, params = _along_triangles(image.corners)
    start = image.at(triangle, params)
    position = np.concatenate(
        [image.deformation.images(start[part]) for part in chunks(len(start), POINTS)]
    )
    found = Seeds(
        np.concatenate([seeds[0], triangle]),
        np.concatenate([seeds[1], params]),
        cKDTree(np.concatenate([seeds[2], position])),
    )

    def accept(triangle: Ints, params: Floats) -> Bools:
        return np.ones(len(triangle), dtype=bool)

    solve = Solver(image.on_triangles, _confine, accept, settle, enough, tolerance)
    feet = nearest(found, solve, points, unknown(len(points), 2), 1)
    # Among needles few seeds lead to the right triangle, so inversion comes before more of them.
    feet = _walk(image, solve, points, feet, BESIDE)
    feet = _by_inversions(image, solve, points, feet)
    feet = _walk(image, solve, points, feet, WALK)
    feet = nearest(found, solve, points, feet, 4)
    feet = nearest(found, solve, points, feet, 12)
    feet = _by_inversions(image, solve, points, feet)
    return _by_pieces(image, solve, points, feet, tolerance)


def _by_pieces(
    image: DeformedMesh, solver: Solver, points: Floats, feet: Feet, tolerance: float
) -> Feet:
    """Search the pieces between the deformation's breaks by bounds, for points still too far."""
    if not np.any(feet.distance > tolerance):
        return feet
    mapping = image.deformation
    triangle, corners = cut_along(image.corners, mapping.breaks)
    # Shrunk: on a break the derivatives may be those of the other side.
    corners += _INSET * (corners.mean(axis=1, keepdims=True) - corners)
    pieces = replace(image, corners=corners, neighbours=np.full((len(corners), 3), -1))

    def at(piece: Ints, params: Floats) -> Floats:
        values = np.ones((len(piece), 4))
        source = pieces.at(piece, _collapse(params))
        for part in chunks(len(piece), POINTS):
            values[part, :3] = mapping.images(source[part])
        return values

    polynomial = not (mapping.rational or mapping.needs_fit) and mapping.degree <= _MOST_DEGREE
    sheets = Sheets(
        np.zeros((len(corners), 2)),
        np.ones((len(corners), 2)),
        at,
        mapping.degree if polynomial else _INTERPOLATED,
        polynomial,
        _collapse,
        lambda piece, low, high: np.ones(len(piece), dtype=bool),
    )
    found = search_all(
        sheets, replace(solver, evaluate=pieces.on_triangles), points, feet, tolerance
    )
    better = np.flatnonzero(found.owner >= 0)
    source = pieces.at(found.owner[better], found.params[better])
    mine = triangle[found.owner[better]]
    owner, params = feet.owner.copy(), feet.params.copy()
    owner[better], params[better] = mine, _confine(mine, image.params_of(mine, source))
    return replace(found, owner=owner, params=params)


def _collapse(params: Floats) -> Floats:
    """Parameters (n, 2) on triangles of points (n, 2) of the unit square.

    A side of the square becomes a corner of the triangle, and polynomials stay polynomials.
    """
    collapsed: Floats = params[:, :1] * np.stack([1 - params[:, 1], params[:, 1]], axis=1)
    return collapsed


def _by_inversions(image: DeformedMesh, solver: Solver, points: Floats, feet: Feet) -> Feet:
    """Feet improved by inverting each map continued beyond its box, and the whole deformation.

    Sheared plates need both.
    """
    for deformation in (*image.deformation.alone, image.deformation):
        feet = _by_inversion(image, deformation, solver, points, feet)
    return feet


def _by_inversion(
    image: DeformedMesh, deformation: ModelMap, solver: Solver, points: Floats, feet: Feet
) -> Feet:
    """Invert the deformation, and search the undeformed triangles nearest to the preimage.

    For points without a good foot, the worst first, while it helps. All triangles are candidates,
    so long and thin neighbours do not hide the right one.
    """
    asked = solver.worst_of(feet)

    def evaluate(_: Ints, points: Floats) -> tuple[Floats, Floats]:
        return deformation.images(points), np.swapaxes(deformation.jacobian(points), 1, 2)

    free = replace(solver, evaluate=evaluate, confine=lambda _, points: points)
    for part in chunks(len(asked), BLOCK):
        which = asked[part]
        start = image.at(feet.owner[which], feet.params[which])
        source, _ = descend(free, feet.owner[which], start, points[which])
        triangle, params = nearest_triangles(image.corners, source)
        for rank in range(triangle.shape[1]):
            far = feet.distance[which] > solver.enough
            mine = np.flatnonzero(far & (triangle[:, rank] >= 0))
            found, start = triangle[mine, rank], params[mine, rank]
            feet = improve(solver, points, feet, which[mine], found, start)
        if np.mean(feet.distance[which] <= max(solver.enough, solver.allowed)) < HELPED:
            break
    return feet


def nearest_triangles(corners: Floats, points: Floats) -> tuple[Ints, Floats]:
    """The ``CANDIDATES`` triangles (T, 3, 3) nearest to each point (n, 3), the nearest first.

    Points are taken in small groups that lie together. Triangles farther from a group than it is
    wide are left out, if there are others, by the slabs that hold a triangle: between its sides,
    and about its plane. So needles count where they pass by only, however long they are.

    Returns
    -------
    triangle : (n, CANDIDATES) int64
        -1 where there are no more.
    params : (n, CANDIDATES, 2) float64
        Parameters of the nearest points.
    """
    sides = corners[:, 1:] - corners[:, :1]
    dual = np.linalg.pinv(np.swapaxes(sides, 1, 2))
    normal = np.cross(sides[:, 0], sides[:, 1])
    long = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, long, out=np.zeros_like(normal), where=long > 0)
    # Gradients of both parameters, of their sum, and of the height.
    slopes = np.concatenate([dual, dual.sum(axis=1, keepdims=True), normal[:, None]], axis=1)
    steep = np.linalg.norm(slopes, axis=2)
    every, start = slopes.reshape(-1, 3), np.einsum("tkx,tx->tk", slopes, corners[:, 0])
    rounding = _INSET * float(np.abs(points).max(initial=0.0) + np.abs(corners).max())
    triangle = np.full((len(points), CANDIDATES), -1, dtype=np.int64)
    params = np.zeros((len(points), CANDIDATES, 2))
    order = cKDTree(points, leafsize=GROUP).indices
    for part in chunks(len(points), GROUP):
        group = order[part]
        low, high = points[group].min(axis=0), points[group].max(axis=0)
        centre = (low + high) / 2
        slack = (float(np.linalg.norm(high - low)) + rounding) * steep
        at = (every @ centre).reshape(-1, 4) - start
        meets = (at[:, 0] >= -slack[:, 0]) & (at[:, 1] >= -slack[:, 1])
        meets &= (at[:, 2] <= 1 + slack[:, 2]) & (np.abs(at[:, 3]) <= slack[:, 3])
        near = np.flatnonzero(meets)
        near = near if len(near) else np.arange(len(corners))
        base = np.einsum("tkx,tx->tk", dual[near], centre - corners[near, 0])
        for few in chunks(len(group), max(1, PAIRS // len(near))):
            mine = group[few]
            foot = (points[mine] - centre) @ dual[near].reshape(-1, 3).T
            foot = foot.reshape(len(mine), -1, 2) + base
            one, two = foot[..., 0], foot[..., 1]
            beyond = np.maximum(one + two - 1, 0) / 2
            one, two = np.clip(one - beyond, 0, 1), np.clip(two - beyond, 0, 1)
            away = np.zeros(one.shape)
            for axis in range(3):
                arm = points[mine, None, axis] - corners[near, 0, axis]
                arm -= one * sides[near, 0, axis] + two * sides[near, 1, axis]
                away += arm * arm
            count = min(CANDIDATES, len(near))
            best = np.argpartition(away, count - 1, axis=1)[:, :count]
            row = np.arange(len(mine))[:, None]
            best = best[row, np.argsort(away[row, best], axis=1)]
            triangle[mine, :count] = near[best]
            params[mine, :count] = np.stack([one[row, best], two[row, best]], axis=2)
    return triangle, params


def _along_triangles(corners: Floats) -> tuple[Ints, Floats]:
    """Seeds inside triangles: four each, more along needles, spaced about by their width.

    None lies on corners or sides, where it would belong to several triangles.
    """
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    longest = np.argmax(lengths, axis=1)
    length = lengths.max(axis=1, initial=0.0)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    width = np.divide(area, length, out=np.ones_like(area), where=length > 0)
    slim = length / np.maximum(width, 1e-6 * length.max(initial=0.0))
    slim *= min(1.0, SEEDS / max(slim.sum(), 1.0))
    count = np.maximum(4, np.ceil(2 * slim)).astype(np.int64)
    triangle, place = expand(count)
    # A chord from the longest side to the other two, at its middle.
    first = longest[triangle]
    row = np.arange(len(triangle))
    arm = sides[triangle][row, first]
    top = corners[triangle][row, (first + 2) % 3] - corners[triangle][row, first]
    foot = (arm * top).sum(axis=1) / np.maximum((arm * arm).sum(axis=1), np.finfo(float).tiny)
    along = (place + 0.5) / count[triangle]
    rising = along < foot
    height = np.where(rising, along / np.where(rising, foot, 1), (1 - along) / (1 - foot + rising))
    height /= 2
    # In barycentric coordinates the point is above ``along`` on the side, ``height`` of the way up.
    weights = np.zeros((len(triangle), 3))
    weights[row, (first + 2) % 3] = height
    weights[row, (first + 1) % 3] = along - foot * height
    weights[row, first] = 1 - along - (1 - foot) * height
    return triangle, weights[:, 1:]


def _walk(image: DeformedMesh, solver: Solver, points: Floats, feet: Feet, triangles: int) -> Feet:
    """Continue in the neighbouring triangle from feet on a side, while it helps."""
    asked = np.flatnonzero(feet.distance > solver.settle)
    for _ in range(triangles):
        if not len(asked):
            break
        before = feet.distance[asked]
        a, b = feet.params[asked].T
        for side, on_side in enumerate((b <= 0, a + b >= 1 - 1e-15, a <= 0)):
            triangle = image.neighbours[feet.owner[asked], side]
            crossing = np.flatnonzero(on_side & (triangle >= 0))
            which, triangle = asked[crossing], triangle[crossing]
            source = image.at(feet.owner[which], feet.params[which])
            start = image.params_of(triangle, source)
            feet = improve(solver, points, feet, which, triangle, start)
        nearer = before - feet.distance[asked] > solver.settle
        going = nearer & (feet.distance[asked] > solver.settle)
        asked = asked[going]
    return feet


def _confine(_: Ints, params: Floats) -> Floats:
    """Nearest parameters within the triangle a, b ≥ 0, a + b ≤ 1."""
    beyond = np.maximum(params.sum(axis=1, keepdims=True) - 1, 0) / 2
    return np.clip(params - beyond, 0, 1)
