"""The deformed mesh: points of it, the distance of other points from it, the volume it encloses.

Only the deformation itself is asked, point by point; nothing here comes from the patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import roots_jacobi

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks, sums
from ffdcli.brep.evaluate.nearest import (
    HELPED,
    Feet,
    Seeds,
    Solver,
    by_boxes,
    descend,
    improve,
    nearest,
    unknown,
)
from ffdcli.brep.evaluate.trim import expand
from ffdcli.deformation import Breaks

# Triangles that get a sample of their own at most.
OWN_SAMPLES = 200_000
# Undeformed triangles tried for one point; pairs of a point and a triangle in one pass.
CANDIDATES = 6
PAIRS = 500_000
# Seeds along needles, at most; triangles a foot may cross on its way.
SEEDS = 300_000
WALK = 50
# As in the volume of faces: the better of two rules does where they agree to this share.
AGREE = 1e-10
POINTS = 65_536
# Share by which pieces are made smaller where they are searched.
_INSET = 1e-12
# Where on each piece a search starts: parameters as of triangles.
_INSIDE = np.array([[4, 4], [2, 2], [8, 2], [2, 8], [5, 5], [2, 5], [5, 2]]) / 12


class ModelMap(Protocol):
    """A deformation of model points, as :class:`ffdcli.deformation.Deformation` is one."""

    @property
    def breaks(self) -> Sequence[Breaks]:
        """Planes across which the deformation is not one polynomial."""
        ...

    @property
    def alone(self) -> Sequence[ModelMap]:
        """The deformation inside each lattice box, continued smoothly beyond it.

        Beside a box the deformation may jump, which keeps points on the box from being traced back.
        """
        ...

    @property
    def degree(self) -> int:
        """Total degree: the largest sum of degrees along three lattice axes."""
        ...

    @property
    def rational(self) -> bool:
        """Whether it is a quotient of polynomials."""
        ...

    def images(self, points: Floats) -> Floats:
        """Images (n, 3) of points (n, 3)."""
        ...

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (n, 3, 3): entry [i, j] is that of coordinate i along j."""
        ...


@dataclass(frozen=True)
class Image:
    """A triangle mesh under a deformation.

    Parameters
    ----------
    corners : (T, 3, 3) float64, model length
        Undeformed triangles.
    neighbours : (T, 3) int64
        Triangle across each side (side i starts at corner i), -1 where there is none.
    deformation : ModelMap
    """

    corners: Floats
    neighbours: Ints
    deformation: ModelMap

    def at(self, triangle: Ints, params: Floats) -> Floats:
        """Undeformed points (n, 3) of triangles at parameters (n, 2)."""
        corner = self.corners[triangle]
        arm = params[:, :, None] * (corner[:, 1:] - corner[:, :1])
        points: Floats = corner[:, 0] + arm.sum(axis=1)
        return points

    def params_of(self, triangle: Ints, points: Floats) -> Floats:
        """Parameters (n, 2) on triangles of the points nearest to undeformed points (n, 3)."""
        sides = self.corners[triangle, 1:] - self.corners[triangle, :1]
        arm = points - self.corners[triangle, 0]
        params: Floats = np.einsum("nij,nj->ni", np.linalg.pinv(np.swapaxes(sides, 1, 2)), arm)
        return params

    def on_triangles(self, triangle: Ints, params: Floats) -> tuple[Floats, Floats]:
        """Images of points of triangles: positions (n, 3) and tangents (n, 2, 3)."""
        sides = self.corners[triangle, 1:] - self.corners[triangle, :1]
        points = self.at(triangle, params)
        position, tangents = np.empty((len(points), 3)), np.empty((len(points), 2, 3))
        for part in chunks(len(points), POINTS):
            position[part] = self.deformation.images(points[part])
            tangents[part] = sides[part] @ np.swapaxes(
                self.deformation.jacobian(points[part]), 1, 2
            )
        return position, tangents


def spread_over(image: Image, wanted: int) -> tuple[Ints, Floats]:
    """Spread points over the undeformed triangles by area, the same on every run.

    Every triangle gets at least one, up to ``OWN_SAMPLES`` of them.

    Returns
    -------
    triangle : (n,) int64
    params : (n, 2) float64
        The point is ``p0 + a (p1 - p0) + b (p2 - p0)``.
    """
    sides = image.corners[:, 1:] - image.corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    random = np.random.default_rng(0)
    count = len(area)
    own = random.permutation(count)[:OWN_SAMPLES]
    share = area / area.sum() if area.sum() > 0 else np.full(count, 1 / max(count, 1))
    more = random.choice(count, size=wanted, p=share) if count else own
    triangle = np.sort(np.concatenate([own, more]))
    params = random.random((len(triangle), 2))
    outside = params.sum(axis=1) > 1
    params[outside] = 1 - params[outside]
    return triangle, params


def distances_to_image(
    image: Image,
    seeds: tuple[Ints, Floats, Floats],
    points: Floats,
    settle: float,
    enough: float,
) -> Feet:
    """Find the nearest point of the deformed mesh for every point (n, 3).

    Parameters
    ----------
    seeds : (n,) triangles, (n, 2) parameters, (n, 3) positions
        Known points of the image; some inside every triangle are added.
    settle, enough : float, model length
        As in :class:`ffdcli.brep.evaluate.nearest.Solver`.
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
    for deformation in (*image.deformation.alone, image.deformation):
        feet = _by_inversion(image, deformation, solve, points, feet)
    return _by_pieces(image, solve, points, feet)


def _by_pieces(image: Image, solver: Solver, points: Floats, feet: Feet) -> Feet:
    """Look on the pieces that the deformation's breaks leave, for points without a good foot.

    On one piece the deformation is smooth; across kinks a search may stick.
    """
    if not np.any(feet.distance > solver.enough):
        return feet
    triangle, corners = _cut_all(image.corners, image.deformation.breaks)
    # A little smaller: on a break slopes may be those of the other side.
    corners += _INSET * (corners.mean(axis=1, keepdims=True) - corners)
    pieces = replace(image, corners=corners, neighbours=np.full((len(corners), 3), -1))
    owner, place = expand(np.full(len(corners), len(_INSIDE)))
    params = _INSIDE[place]
    position, _ = pieces.on_triangles(owner, params)
    seeds = Seeds(owner, params, cKDTree(position))
    low, high = np.full((len(corners), 3), np.inf), np.full((len(corners), 3), -np.inf)
    np.minimum.at(low, owner, position)
    np.maximum.at(high, owner, position)
    # Seeds do not reach the corners.
    margin = np.linalg.norm(high - low, axis=1, keepdims=True) / 2
    boxes = np.stack([low - margin, high + margin], axis=1)
    nowhere = np.full(len(points), -1, dtype=np.int64)
    solve = replace(solver, evaluate=pieces.on_triangles)
    found = by_boxes(seeds, solve, points, replace(feet, owner=nowhere), boxes)
    better = np.flatnonzero(found.owner >= 0)
    source = pieces.at(found.owner[better], found.params[better])
    mine = triangle[found.owner[better]]
    return improve(solver, points, feet, better, mine, image.params_of(mine, source))


def _by_inversion(
    image: Image, deformation: ModelMap, solver: Solver, points: Floats, feet: Feet
) -> Feet:
    """Undo a deformation, and look for the undeformed triangles nearest to what comes out.

    For points that have no good foot, worst first, going on while it helps. Every triangle is
    looked at, so the right one is not missed however long and thin its neighbours are.
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
    """Spread seeds inside triangles: four in each, more along needles, about as far apart as wide.

    Not on corners and sides: there a seed would stand for the wrong triangle.
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


def _walk(image: Image, solver: Solver, points: Floats, feet: Feet) -> Feet:
    """Go on in the neighbouring triangle where a foot has come to lie on a side, while it helps."""
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


def fluxes(image: Image, centre: Floats, *, agree: float = AGREE) -> Floats:
    """(T,) flux of (x - centre) / 3 through the image of every triangle, cubed model length.

    Triangles are cut where the deformation has breaks, so each piece's integrand is a polynomial
    of total degree ``3 d - 2``, d the degree of the deformation; its rule is exact. Lower
    rules are tried first and do where two of them agree, to the share ``agree`` of a piece's mean.
    Quotients have no exact rule: higher ones follow.
    """
    owner, corners = _cut_all(image.corners, image.deformation.breaks)
    exact = -(-(3 * image.deformation.degree - 1) // 2)
    rules = [rule for rule in (2, 3, 5, 8) if rule < exact] + [exact]
    rules += [2 * exact, 4 * exact] if image.deformation.rational else []
    todo = np.arange(len(owner))
    best = _triangle_fluxes(image, corners, rules[0], centre)
    for rule in rules[1:]:
        better = _triangle_fluxes(image, corners[todo], rule, centre)
        limit = agree * np.abs(best).sum() / max(len(owner), 1)
        going = np.abs(better - best[todo]) > limit
        best[todo] = better
        todo = todo[going]
        if not len(todo):
            break
    return sums(owner, best, len(image.corners))


def _triangle_fluxes(image: Image, corners: Floats, rule: int, centre: Floats) -> Floats:
    """(n,) flux through the images of triangles (n, 3, 3), by a rule of rule² points."""
    # Collapsed square: Gauss-Jacobi towards the first corner, Gauss-Legendre across.
    out, out_weights = roots_jacobi(rule, 0, 1)
    over, over_weights = np.polynomial.legendre.leggauss(rule)
    out, over = (out + 1) / 2, (over + 1) / 2
    params = np.stack([(out[:, None] * (1 - over)).ravel(), (out[:, None] * over).ravel()], axis=1)
    weights = np.outer(out_weights / 4, over_weights / 2).ravel()
    flux = np.empty(len(corners))
    for part in chunks(len(corners), max(1, POINTS // len(weights))):
        corner = corners[part]
        sides = corner[:, 1:] - corner[:, :1]
        points = (corner[:, :1] + params @ sides).reshape(-1, 3)
        arm = image.deformation.images(points) - centre
        turned = np.repeat(sides, len(weights), axis=0) @ np.swapaxes(
            image.deformation.jacobian(points), 1, 2
        )
        value = (arm * np.cross(turned[:, 0], turned[:, 1])).sum(axis=1) / 3
        flux[part] = value.reshape(len(corner), -1) @ weights
    return flux


def _cut_all(corners: Floats, breaks: Sequence[Breaks]) -> tuple[Ints, Floats]:
    """Cut triangles along all breaks: the triangle each piece is of, and the pieces' corners."""
    owner = np.arange(len(corners))
    for planes in breaks:
        piece, corners = _cut(corners, planes)
        owner = owner[piece]
    return owner, corners


def _cut(corners: Floats, breaks: Breaks) -> tuple[Ints, Floats]:
    """Cut triangles along all breaks: the triangle each piece is of, and the pieces' corners.

    A soup: neighbouring pieces need not share vertices, only cover the same area.
    """
    owner = np.arange(len(corners))
    local = (corners - breaks.origin) @ breaks.axes.T
    for axis, values in enumerate(breaks.values):
        for value in np.unique(values):
            height = local[:, :, axis] - value
            crossed = (height.min(axis=1) < 0) & (height.max(axis=1) > 0)
            if not crossed.any():
                continue
            height = height[crossed]
            above = height > 0
            single = np.where(above.sum(axis=1) == 1, above.T, (height < 0).T).T
            turn = (np.argmax(single, axis=1)[:, None] + np.arange(3)) % 3
            row = np.arange(len(turn))[:, None]
            height = height[row, turn]
            pieces = [_three(points[crossed][row, turn], height) for points in (corners, local)]
            corners = np.concatenate([corners[~crossed], pieces[0]])
            local = np.concatenate([local[~crossed], pieces[1]])
            owner = np.concatenate([owner[~crossed], np.tile(owner[crossed], 3)])
    return owner, corners


def _three(corner: Floats, height: Floats) -> Floats:
    """Cut triangles (n, 3, 3) whose first corner is alone on its side: (3 n, 3, 3) pieces."""
    ratio = height[:, :1] / (height[:, :1] - height[:, 1:])
    cut = corner[:, :1] + ratio[:, :, None] * (corner[:, 1:] - corner[:, :1])
    return np.concatenate(
        [
            np.stack([corner[:, 0], cut[:, 0], cut[:, 1]], axis=1),
            np.stack([cut[:, 0], corner[:, 1], corner[:, 2]], axis=1),
            np.stack([cut[:, 0], corner[:, 2], cut[:, 1]], axis=1),
        ]
    )
