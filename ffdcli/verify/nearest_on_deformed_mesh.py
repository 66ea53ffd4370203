"""Nearest points of the deformed mesh to given points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.branch_and_bound import Sheets, search_all
from ffdcli.brep.evaluate.bspline import chunks
from ffdcli.brep.evaluate.nearest import (
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

# Undeformed triangles tried for each point, and pairs of point and triangle per pass.
CANDIDATES = 6
PAIRS = 500_000
# Largest number of seeds along needles; largest number of triangles a foot may cross.
SEEDS = 300_000
WALK = 50
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

    solve = Solver(image.on_triangles, _confine, accept, settle, enough)
    feet = nearest(found, solve, points, unknown(len(points), 2), 1)
    feet = _walk(image, solve, points, feet)
    feet = nearest(found, solve, points, feet, 4)
    feet = nearest(found, solve, points, feet, 12)
    # Sheared plates need both: each map continued beyond its box, and the whole deformation.
    for deformation in (*image.deformation.alone, image.deformation):
        feet = _by_inversion(image, deformation, solve, points, feet)
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


def _by_inversion(
    image: DeformedMesh, deformation: ModelMap, solver: Solver, points: Floats, feet: Feet
) -> Feet:
    """Invert the deformation, and search the undeformed triangles nearest to the preimage.

    For points without a good foot, the worst first, while it helps. All triangles are candidates,
    so long and thin neighbours do not hide the right one.
    """
    asked = np.flatnonzero(feet.distance > solver.enough)
    asked = asked[np.argsort(-feet.distance[asked], kind="stable")]
    sides = image.corners[:, 1:] - image.corners[:, :1]
    dual = np.linalg.pinv(np.swapaxes(sides, 1, 2))

    def evaluate(_: Ints, points: Floats) -> tuple[Floats, Floats]:
        return deformation.images(points), np.swapaxes(deformation.jacobian(points), 1, 2)

    free = replace(solver, evaluate=evaluate, confine=lambda _, points: points)
    for part in chunks(len(asked), max(1, PAIRS // len(image.corners))):
        which = asked[part]
        start = image.at(feet.owner[which], feet.params[which])
        source, _ = descend(free, feet.owner[which], start, points[which])
        arm = source[:, None] - image.corners[:, 0]
        params = np.einsum("tkx,ntx->ntk", dual, arm)
        params = _confine(which, params.reshape(-1, 2)).reshape(params.shape)
        arm -= np.einsum("ntk,tkx->ntx", params, sides)
        nearby = np.argsort((arm * arm).sum(axis=2), axis=1)[:, :CANDIDATES]
        row = np.repeat(np.arange(len(which)), nearby.shape[1])
        triangle = nearby.ravel()
        feet = improve(solver, points, feet, which[row], triangle, params[row, triangle])
        if np.mean(feet.distance[which] <= solver.enough) < HELPED:
            break
    return feet


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


def _walk(image: DeformedMesh, solver: Solver, points: Floats, feet: Feet) -> Feet:
    """Continue in the neighbouring triangle from feet on a side, while it helps."""
    asked = np.flatnonzero(feet.distance > solver.settle)
    for _ in range(WALK):
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
        going = (feet.distance[asked] < before) & (feet.distance[asked] > solver.settle)
        asked = asked[going]
    return feet


def _confine(_: Ints, params: Floats) -> Floats:
    """Nearest parameters within the triangle a, b ≥ 0, a + b ≤ 1."""
    beyond = np.maximum(params.sum(axis=1, keepdims=True) - 1, 0) / 2
    return np.clip(params - beyond, 0, 1)
