"""Nearest points by damped Gauss-Newton steps from seeds, for many points at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks

# (owners (n,), parameters (n, k)) -> positions (n, 3), tangents (n, k, 3)
Evaluate = Callable[[Ints, Floats], tuple[Floats, Floats]]
# (owners (n,), parameters (n, k)) -> the nearest allowed parameters (n, k)
Confine = Callable[[Ints, Floats], Floats]
# (owners (n,), parameters (n, k)) -> (n,) whether the foot counts
Accept = Callable[[Ints, Floats], Bools]

STEPS = 25
# With up to EASY_RANKS seeds each, all points are searched. With more, points are searched in
# blocks, the worst first, while a block helps at least the share HELPED of its points.
EASY_RANKS = 4
BLOCK = 20_000
HELPED = 0.1
# Points within the distance allowed that are searched from many seeds all the same.
WITHIN = 1000


@dataclass(frozen=True)
class Seeds:
    """Start points of searches, with their owners and parameters.

    Parameters
    ----------
    owner : (n,) int64
    params : (n, k) float64
    tree : k-d tree of their positions
    """

    owner: Ints
    params: Floats
    tree: cKDTree


@dataclass(frozen=True)
class Feet:
    """The nearest points found.

    Parameters
    ----------
    distance : (n,) float64, model length; infinite where nothing was found.
    owner : (n,) int64, -1 where nothing was found.
    params : (n, k) float64
    least : (n,) float64, model length
        No point of any owner is nearer than this, as far as :func:`branch_and_bound.search_all`
        proved it; 0 where it was not asked.
    """

    distance: Floats
    owner: Ints
    params: Floats
    least: Floats

    def take(self, part: slice) -> Feet:
        """The feet of some points."""
        return Feet(self.distance[part], self.owner[part], self.params[part], self.least[part])


@dataclass(frozen=True)
class Solver:
    """Geometry and stopping distances of a search for nearest points.

    Parameters
    ----------
    evaluate : positions and tangents at parameters
    confine : the nearest parameters the owner has
    accept : whether a foot counts (it may lie outside the outline)
    settle : float, model length
        Rounding level: smaller distances are not improved, smaller steps not taken.
    enough : float, model length
        Smaller distances are improved from the nearest few seeds only.
    allowed : float, model length
        Distances up to this one need not be known well. Every distance found is that of a point of
        the surface, so more searching makes it smaller only.
    """

    evaluate: Evaluate
    confine: Confine
    accept: Accept
    settle: float
    enough: float
    allowed: float = 0.0

    def worst_of(self, feet: Feet) -> Ints:
        """Points that are worth a long search, the worst first.

        All beyond the distance allowed, and ``WITHIN`` others, so that the largest distance is
        known better where few points are poor. Among needles most points may be.
        """
        asked = np.flatnonzero(feet.distance > self.enough)
        asked = asked[np.argsort(-feet.distance[asked], kind="stable")]
        return asked[: int((feet.distance > self.allowed).sum()) + WITHIN]


def unknown(count: int, size: int) -> Feet:
    """Feet of ``count`` points before any search, with ``size`` parameters each."""
    nothing = np.full(count, -1, dtype=np.int64)
    return Feet(np.full(count, np.inf), nothing, np.zeros((count, size)), np.zeros(count))


def descend(solver: Solver, owner: Ints, start: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Parameters at which the position is locally nearest to the target.

    Parameters
    ----------
    owner : (n,) int64
    start : (n, k) float64
    target : (n, 3) float64, model length

    Returns
    -------
    params : (n, k) float64
    distance : (n,) float64
        Accurate to rounding if small, to a thousandth otherwise, and never too small.
    """
    params = solver.confine(owner, start)
    position, tangents = solver.evaluate(owner, params)
    distance = np.linalg.norm(target - position, axis=1)
    damping = np.zeros(len(owner))
    active = np.flatnonzero(distance > solver.settle)
    for _ in range(STEPS):
        if not len(active):
            break
        before, free = distance[active], damping[active] == 0
        step = _step(tangents[active], target[active] - position[active], damping[active])
        wish = params[active] + step
        trial = solver.confine(owner[active], wish)
        clipped = np.any(trial != wish, axis=1)
        if clipped.any():
            held = active[clipped]
            trial[clipped] = _slide(
                partial(solver.confine, owner[held]), params[held], trial[clipped],
                tangents[held], target[held] - position[held], damping[held],
            )  # fmt: skip
        moved = trial - params[active]
        length = np.linalg.norm((moved[:, :, None] * tangents[active]).sum(axis=1), axis=1)
        there, slopes = solver.evaluate(owner[active], trial)
        near = np.linalg.norm(target[active] - there, axis=1)
        better = near < before
        taken, worse = active[better], active[~better]
        params[taken], position[taken] = trial[better], there[better]
        tangents[taken], distance[taken] = slopes[better], near[better]
        damping[taken] *= np.where(damping[taken] > 1e-4, 1 / 16, 0)
        damping[worse] = np.maximum(8 * damping[worse], 1e-2)
        # A full step that hardly helps, far from the target: a local minimum.
        stuck = free & better & (near > solver.enough) & (before - near < 1e-4 * before)
        going = (length > solver.settle) & (distance[active] > solver.settle) & ~stuck
        # Clipped at a border without progress: the foot is on a neighbour.
        outside = clipped & ~better & (damping[active] > 0.5)
        active = active[going & ~outside & (damping[active] < 1e6)]
    return params, distance


def _slide(
    confine: Callable[[Floats], Floats],
    params: Floats,
    trial: Floats,
    tangents: Floats,
    miss: Floats,
    damping: Floats,
) -> Floats:
    """Parameters (n, k) that a step clipped at a border reaches by continuing along it.

    If tangents are far from perpendicular, clipping alone may lead away from the target.
    """
    rest = miss - (np.subtract(trial, params)[:, :, None] * tangents).sum(axis=1)
    for k in range(tangents.shape[1]):
        along = tangents[:, k]
        square = np.maximum((along * along).sum(axis=1), np.finfo(float).tiny)
        wish = trial.copy()
        wish[:, k] += (along * rest).sum(axis=1) / square / (1 + damping)
        there = confine(wish)
        rest -= ((there - trial)[:, :, None] * tangents).sum(axis=1)
        trial = there
    return trial


def _step(tangents: Floats, miss: Floats, damping: Floats) -> Floats:
    """Damped least-squares step (n, k) for tangents (n, k, 3) and misses (n, 3)."""
    norms = np.linalg.norm(tangents, axis=2)
    norms[norms == 0] = 1.0
    unit = tangents / norms[:, :, None]
    normal = unit @ np.swapaxes(unit, 1, 2)
    # The constant keeps parallel tangents solvable; Gauss-Newton tolerates its error.
    diagonal = np.arange(tangents.shape[1])
    normal[:, diagonal, diagonal] += damping[:, None] + 1e-13
    right = unit @ miss[:, :, None]
    step: Floats = np.linalg.solve(normal, right)[:, :, 0]
    return step / norms


def nearest(seeds: Seeds, solver: Solver, points: Floats, known: Feet, ranks: int) -> Feet:
    """Improve feet of points (n, 3) by trying the owners of the ``ranks`` nearest seeds.

    Seeds are tried in order of distance, each owner once.
    """
    ranks = min(ranks, len(seeds.owner))
    if ranks <= EASY_RANKS:
        asked = np.flatnonzero(known.distance > solver.settle)
        return _try_seeds(seeds, solver, points, known, asked, ranks, solver.settle)
    asked = solver.worst_of(known)
    size = BLOCK * 12 // ranks
    for part in chunks(len(asked), size):
        known = _try_seeds(seeds, solver, points, known, asked[part], ranks, solver.enough)
        if np.mean(known.distance[asked[part]] <= solver.enough) < HELPED:
            break
    return known


def _try_seeds(
    seeds: Seeds, solver: Solver, points: Floats, feet: Feet, asked: Ints, ranks: int, good: float
) -> Feet:
    """Search from the nearest seeds of some points until a foot is nearer than ``good``."""
    if not ranks or not len(asked):
        return feet
    _, found = seeds.tree.query(points[asked], k=np.arange(1, ranks + 1))
    owners = seeds.owner[found]
    for rank in range(ranks):
        fresh = np.all(owners[:, :rank] != owners[:, rank, None], axis=1)
        mine = np.flatnonzero(fresh & (feet.distance[asked] > good))
        start = seeds.params[found[mine, rank]]
        feet = improve(solver, points, feet, asked[mine], owners[mine, rank], start)
    return feet


def improve(
    solver: Solver, points: Floats, feet: Feet, which: Ints, owner: Ints, start: Floats
) -> Feet:
    """Improve the feet of points ``which`` by the owner (n,) given for each, from ``start``."""
    if not len(which):
        return feet
    params, distance = descend(solver, owner, start, points[which])
    nearer = np.flatnonzero(distance < feet.distance[which])
    nearer = nearer[solver.accept(owner[nearer], params[nearer])]
    # Where a point is named twice, the nearest of its feet comes last, and stays.
    nearer = nearer[np.argsort(-distance[nearer], kind="stable")]
    best, owners, spots = feet.distance.copy(), feet.owner.copy(), feet.params.copy()
    best[which[nearer]] = distance[nearer]
    owners[which[nearer]] = owner[nearer]
    spots[which[nearer]] = params[nearer]
    return replace(feet, distance=best, owner=owners, params=spots)
