"""Distances of points from the faces or lines of a shape.

Where the file kept a face's parameters, the distance at the same parameters is measured. It is
never below the distance of the nearest point, and it needs no search. Elsewhere the nearest point
is searched for, and "too far" is proved by bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.branch_and_bound import Sheets, search_all
from ffdcli.brep.evaluate.nearest import Feet, Seeds, Solver, improve, nearest, unknown
from ffdcli.verify.part.shape import DeformedShape
from ffdcli.verify.part.spots import Spots

# Degree by which pieces are interpolated for their boxes.
DEGREE = 6
# Faces or lines for which too great distances are proved; one is enough for the verdict.
PROVED = 3


@dataclass(frozen=True, eq=False)
class Target:
    """Faces or lines to which distances are measured.

    Parameters
    ----------
    breaks : per owner, one array for each of k parameters
    evaluate : (owners (n,), parameters (n, k)) -> positions (n, 3), tangents (n, k, 3)
    spots : Spots
        Start points of searches.
    accept : (owners (n,), parameters (n, k)) -> (n,) whether they count
    """

    breaks: tuple[tuple[Floats, ...], ...]
    evaluate: Callable[[Ints, Floats], tuple[Floats, Floats]]
    spots: Spots
    accept: Callable[[Ints, Floats], Bools] = lambda owner, _: np.ones(len(owner), dtype=bool)

    @classmethod
    def faces(cls, image: DeformedShape, spots: Spots) -> Target:
        """The faces of a deformed shape, untrimmed."""
        return cls(image.shape.face_breaks, image.on_faces, spots)

    @classmethod
    def lines(cls, image: DeformedShape, spots: Spots) -> Target:
        """The lines of a deformed shape."""
        return cls(tuple((each,) for each in image.line_breaks), image.on_lines, spots)

    def shares(self, owner: Ints, params: Floats) -> Floats:
        """Parameters (n, k) as shares of the owners' ranges."""
        low, high = self._ends(owner)
        return np.divide(params - low, high - low, out=np.zeros_like(params), where=high > low)

    def at_shares(self, owner: Ints, shares: Floats) -> Floats:
        """Parameters (n, k) at shares of the owners' ranges."""
        low, high = self._ends(owner)
        return self.confine(owner, low + shares * (high - low))

    def confine(self, owner: Ints, params: Floats) -> Floats:
        """Nearest parameters (n, k) that the owners have."""
        inside: Floats = np.clip(params, *self._ends(owner))
        return inside

    def _ends(self, owner: Ints) -> tuple[Floats, Floats]:
        ends = np.array([[(axis[0], axis[-1]) for axis in each] for each in self.breaks])
        low, high = np.moveaxis(ends.reshape(len(self.breaks), -1, 2)[owner], 2, 0)
        return low, high


def measure(
    target: Target,
    owner: Ints,
    start: Floats,
    same: Bools,
    points: Floats,
    settle: float,
    tolerance: float,
    *,
    prove: bool = True,
) -> Feet:
    """Distances of points (n, 3) from the face or line of each.

    Parameters
    ----------
    owner : (n,) int64
        Face or line of each point, -1 if it may be any.
    start : (n, k) float64
        Parameters at which the point should be.
    same : (n,) bool
        Measure there, and nowhere else.
    settle, tolerance : float, model length
        Level of rounding errors; distance allowed.
    prove : bool
        Search by bounds where other searches found nothing near enough.

    Returns
    -------
    Feet
        ``least`` is at least ``tolerance`` where the distance is proved to be above it.
    """
    feet = unknown(len(points), start.shape[1])
    known = np.flatnonzero(owner >= 0)
    params = target.confine(owner[known], start[known])
    gap = np.linalg.norm(target.evaluate(owner[known], params)[0] - points[known], axis=1)
    feet.distance[known], feet.owner[known], feet.params[known] = gap, owner[known], params
    feet.least[same] = feet.distance[same]
    solver = _solver(target, settle, tolerance)
    free = np.flatnonzero(~same)
    if not len(free):
        return feet
    tried = free[owner[free] >= 0]
    feet = improve(solver, points, feet, tried, owner[tried], feet.params[tried])
    open_ = free[feet.distance[free] > tolerance]
    proved = 0 if prove else PROVED
    for one in np.unique(owner[open_]):
        mine = open_[owner[open_] == one]
        group = np.array([one]) if one >= 0 else np.unique(target.spots.owner)
        found = _in_group(target, solver, group, points[mine], _some(feet, mine))
        if proved < PROVED and np.any(found.distance > tolerance):
            found = _by_bounds(target, solver, group, points[mine], found, tolerance)
            proved += int(np.any(found.least >= tolerance))
        feet.distance[mine], feet.owner[mine] = found.distance, found.owner
        feet.params[mine], feet.least[mine] = found.params, found.least
    return feet


def _solver(target: Target, settle: float, tolerance: float) -> Solver:
    enough = max(settle, tolerance / 2)
    return Solver(target.evaluate, target.confine, target.accept, settle, enough)


def _in_group(target: Target, solver: Solver, group: Ints, points: Floats, feet: Feet) -> Feet:
    """Feet improved by searches from the spots of some owners."""
    spots = target.spots
    mine = np.flatnonzero(np.isin(spots.owner, group))
    if not len(mine):
        return feet
    tree = cKDTree(spots.position[mine])
    if len(group) > 1:
        seeds = Seeds(spots.owner[mine], spots.params[mine], tree)
        for ranks in (1, 4, 12):
            feet = nearest(seeds, solver, points, feet, ranks)
        return feet
    # Seeds of one owner: each is tried, not only the nearest.
    _, found = tree.query(points, k=np.arange(1, min(4, len(mine)) + 1))
    for rank in found.T:
        which = np.flatnonzero(feet.distance > solver.enough)
        start = mine[rank[which]]
        feet = improve(solver, points, feet, which, spots.owner[start], spots.params[start])
    return feet


def _by_bounds(
    target: Target, solver: Solver, group: Ints, points: Floats, feet: Feet, tolerance: float
) -> Feet:
    """Search all pieces between the breaks of some owners by bounds."""
    lows, highs, owners = [], [], []
    for one in group:
        axes = [*target.breaks[one], np.array([0.0, 1.0])][:2]
        low, high = (
            np.stack(np.meshgrid(*(axis[part] for axis in axes), indexing="ij"), axis=-1)
            for part in (slice(None, -1), slice(1, None))
        )
        lows.append(low.reshape(-1, 2))
        highs.append(high.reshape(-1, 2))
        owners.append(np.full(len(lows[-1]), one))
    of = np.concatenate(owners)
    k = len(target.breaks[group[0]])

    def at(piece: Ints, params: Floats) -> Floats:
        position, _ = target.evaluate(of[piece], params[:, :k])
        return np.concatenate([position, np.ones((len(piece), 1))], axis=1)

    sheets = Sheets(
        np.concatenate(lows),
        np.concatenate(highs),
        at,
        DEGREE,
        exact=False,
        params=lambda params: params[:, :k],
        holds=lambda piece, low, high: np.ones(len(piece), dtype=bool),
    )
    pieces = replace(
        solver,
        evaluate=lambda piece, params: target.evaluate(of[piece], params),
        confine=lambda piece, params: target.confine(of[piece], params),
        accept=lambda piece, params: target.accept(of[piece], params),
    )
    found = search_all(sheets, pieces, points, feet, tolerance)
    better = found.owner >= 0
    owner = np.where(better, of[found.owner], feet.owner)
    return replace(found, owner=owner)


def _some(feet: Feet, which: Ints) -> Feet:
    return Feet(feet.distance[which], feet.owner[which], feet.params[which], feet.least[which])
