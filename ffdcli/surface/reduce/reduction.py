"""Reduction of spline patches: fewer control points within a certified distance.

Every patch gets the smallest of many candidate spaces that meets its tolerance. Candidates are
chosen by estimates along each direction: the error of a fit at sites (root mean square, hence less
than the largest error). Then follow least squares in both directions, and the bound of
:mod:`~ffdcli.surface.reduce.bound`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.spline_spaces import Grid, project
from ffdcli.surface.reduce.bound import certified_distance, on_both
from ffdcli.surface.reduce.candidates import Direction, Level, make_direction

# Coordinates of control points that are processed together.
_CHUNK_NUMBERS = 200_000
# Share of the tolerance below which the error of a level makes larger levels needless.
_PLENTY = 0.1
# Share of the ratio of bound to estimate that is assumed for other levels of the same patch.
_ALIKE = 0.7
# Reduced weights keep at least this share of the least one.
_WEIGHT_SHARE = 0.1
# Stands for the cells of the source.
_WHOLE = Level(0, 0)
_ULP = float(np.finfo(float).eps)


@dataclass(frozen=True)
class TensorSplines:
    """Tensor-product splines that share degrees and multiplicities.

    Parameters
    ----------
    degrees : (int, int)
    knots : two (m, nb) float64
        Distinct knots.
    mults : two (nb,) int64
        Multiplicities; the end ones are ``degree + 1``.
    poles : (m, nu, nv, 3 or 4) float64, model length
        Homogeneous where there are 4 components. A curve is a patch of degree 0 along v.
    """

    degrees: tuple[int, int]
    knots: tuple[Floats, Floats]
    mults: tuple[Ints, Ints]
    poles: Floats

    def take(self, rows: Ints) -> TensorSplines:
        """The chosen splines alone."""
        knots = (self.knots[0][rows], self.knots[1][rows])
        return replace(self, knots=knots, poles=self.poles[rows])


@dataclass(frozen=True)
class Reduced:
    """Patches after reduction.

    Parameters
    ----------
    rows : (n,) int64
        Indices of these patches in the input.
    patches : TensorSplines
    bounds : (n,) float64, model length
        Certified distance from the input, parameter by parameter; 0 where unchanged.
    """

    rows: Ints
    patches: TensorSplines
    bounds: Floats


def reduce_patches(
    patches: TensorSplines,
    tolerances: Floats,
    *,
    step: float = 0.0,
    max_degree: int | None = None,
    keep_ends: bool = False,
) -> list[Reduced]:
    """Approximate every patch with as few control points as its tolerance allows.

    Parameters
    ----------
    patches : TensorSplines
    tolerances : (m,) float64, model length
    step : float, model length
        New control points are multiples of it, which keeps files short; bounds allow for it.
    max_degree : int, optional
        Highest degree. Where the tolerance is not met, spans are divided; where that does not
        help either, bounds are larger than tolerances.
    keep_ends : bool
        Keep the first and last control points along u, for curves that meet at vertices.

    Returns
    -------
    list of Reduced
        Together they contain every patch once.

    Notes
    -----
    Fits are least squares at Chebyshev sites: on a single span, the truncated Chebyshev series.
    For the numerical behaviour of Bernstein forms see Farouki and Rajan 1988.
    """
    m = len(patches.poles)
    numbers = int(np.prod(patches.poles.shape[1:]))
    count = max(1, -(-m * numbers // _CHUNK_NUMBERS))
    out: list[Reduced] = []
    for rows in np.array_split(np.arange(m), min(count, m)):
        search = _Search.start(patches.take(rows), tolerances[rows], step, max_degree, keep_ends)
        out += [replace(found, rows=rows[found.rows]) for found in search.run()]
    return out


@dataclass(frozen=True)
class _Search:
    """The input of all trials on some patches.

    ``points`` are control points (m, nu, d, nv) relative to ``centre`` (m, 3), coordinates between
    the directions.
    """

    patches: TensorSplines
    tolerances: Floats
    step: float
    keep_ends: bool
    capped: bool
    directions: tuple[Direction, Direction]
    grids: tuple[Grid, Grid]
    levels: tuple[list[list[Level]], list[list[Level]]]
    centre: Floats
    points: Floats

    @staticmethod
    def start(
        patches: TensorSplines,
        tolerances: Floats,
        step: float,
        max_degree: int | None,
        keep_ends: bool,
    ) -> _Search:
        poles = patches.poles
        middle = poles.reshape(len(poles), -1, poles.shape[-1]).mean(axis=1)
        centre = middle[:, :3] / middle[:, 3:] if poles.shape[-1] == 4 else middle
        directions = []
        for axis in range(2):
            along = poles if axis == 0 else poles.swapaxes(1, 2)
            directions.append(
                make_direction(
                    patches.degrees[axis], patches.knots[axis], patches.mults[axis], along
                )
            )
        first, second = directions
        return _Search(
            patches=patches,
            tolerances=tolerances,
            step=step,
            keep_ends=keep_ends,
            capped=max_degree is not None and max(patches.degrees) > max_degree,
            directions=(first, second),
            grids=(first.grid(_WHOLE), second.grid(_WHOLE)),
            levels=(first.levels(max_degree), second.levels(max_degree)),
            centre=centre,
            points=_moved(poles, -centre).transpose(0, 1, 3, 2),
        )

    def run(self) -> Iterator[Reduced]:
        """Reduce all patches; yields them in groups that share a space."""
        losses = [self._losses(axis) for axis in range(2)]
        flat = [[level for ladder in ladders for level in ladder] for ladders in self.levels]
        sizes = [np.array([self._size(axis, x) for x in flat[axis]]) for axis in range(2)]
        cost = np.multiply.outer(*sizes)
        lost = np.hypot(losses[0][:, :, None], losses[1][:, None, :]).reshape(len(self.points), -1)
        rank = np.argsort(cost.ravel(), kind="stable")
        if not self.capped:
            # The source is the last pair; pairs that are not smaller are dropped.
            exact = cost.size - 1
            rank = np.append(rank[cost.ravel()[rank] < cost.ravel()[exact]], exact)
        lost = lost[:, rank]
        pairs = [divmod(int(number), cost.shape[1]) for number in rank]

        pending = np.arange(len(self.points))
        place = np.full(len(pending), -1)
        factor = np.ones(len(pending))
        while len(pending):
            ahead = np.arange(len(pairs)) > place[pending, None]
            worth = lost[pending] * factor[pending, None] <= self.tolerances[pending, None]
            worth &= ahead
            found = np.asarray(worth.any(axis=1))
            place[pending] = np.argmax(worth, axis=1)
            # Where no candidate is left, the one with the smallest loss is taken.
            without = pending[np.logical_not(found)]
            place[without] = np.argmin(lost[without], axis=1)
            left = []
            for number in np.unique(place[pending]):
                chosen = place[pending] == number
                rows, last = pending[chosen], np.logical_not(found[chosen])
                k, j = pairs[number]
                tried = self._try(rows, flat[0][k], flat[1][j])
                done = (tried.bounds <= self.tolerances[rows]) | last
                if done.any():
                    yield Reduced(
                        rows[done], tried.patches.take(np.flatnonzero(done)), tried.bounds[done]
                    )
                failed = rows[~done]
                ratio = tried.bounds[~done] / np.maximum(lost[failed, number], 1e-300)
                factor[failed] = np.maximum(1.0, _ALIKE * ratio)
                left.append(failed)
            pending = np.concatenate(left)

    def _size(self, axis: int, level: Level) -> int:
        _, mults = self.directions[axis].take(np.zeros(1, dtype=np.int64)).knots_of(level)
        return int(mults.sum()) - level.degree - 1

    def _losses(self, axis: int) -> Floats:
        """(m, levels) root mean square error of each level along one direction.

        Infinite for levels that were not computed because a smaller space of the same degree is
        accurate enough.
        """
        out = []
        everything = np.arange(len(self.points))
        for ladder in self.levels[axis]:
            remaining = everything
            for level in ladder:
                lost = np.full(len(everything), np.inf)
                if level.exact:
                    lost[:] = 0.0
                elif len(remaining):
                    lost[remaining] = self._loss(axis, level, remaining)
                    enough = lost[remaining] <= _PLENTY * self.tolerances[remaining]
                    remaining = remaining[~enough]
                out.append(lost)
        return np.stack(out, axis=1)

    def _loss(self, axis: int, level: Level, rows: Ints) -> Floats:
        """(n,) root mean square error, at sites, of a level along one direction."""
        here, across = self._grid(axis, level, rows), self.grids[1 - axis].take(rows)
        points = self.points[rows]
        if axis == 1:
            points = points.transpose(0, 3, 2, 1)
        target = self.directions[axis].take(rows).target(level)
        lost = project(target, here, keep_ends=self.keep_ends and axis == 0)
        gap = on_both(lost.residual, points, across.values)
        if gap.shape[2] == 4:
            value = on_both(here.values, points, across.values)
            weight = value[:, :, 3:]
            roots = here.roots[:, :, None, None] * across.roots[:, None, None, :]
            gap = (gap[:, :, :3] - value[:, :, :3] / weight * gap[:, :, 3:]) * roots / weight
        return np.asarray(np.sqrt((gap**2).sum(axis=(1, 2, 3))))

    def _grid(self, axis: int, level: Level, rows: Ints) -> Grid:
        if level.parts > 1:
            return self.directions[axis].take(rows).grid(level)
        return self.grids[axis].take(rows)

    def _try(self, rows: Ints, first: Level, second: Level) -> Reduced:
        """Fit patches in a pair of levels, with certified bounds."""
        patches = self.patches.take(rows)
        if first.exact and second.exact:
            return Reduced(rows, patches, np.zeros(len(rows)))
        matrices, spaces, grids, targets = [], [], [], []
        for axis, level in enumerate((first, second)):
            this = self.directions[axis].take(rows)
            grids.append(self._grid(axis, level, rows))
            targets.append(this.target(level))
            spaces.append(this.knots_of(level))
            if level.exact:
                matrices.append(np.eye(this.source.size)[None])
            else:
                ends = self.keep_ends and axis == 0
                matrices.append(project(targets[axis], grids[axis], keep_ends=ends).matrix)
        points, centre = self.points[rows], self.centre[rows]
        fitted = on_both(matrices[0], points, matrices[1])
        poles = _moved(fitted.transpose(0, 1, 3, 2), centre)
        if self.step and poles.shape[-1] == 3:
            poles = np.round(poles / self.step) * self.step
        if self.keep_ends:
            poles[:, [0, -1]] = patches.poles[:, [0, -1]]
        # The bounds hold for the rounded control points.
        fitted = _moved(poles, -centre).transpose(0, 1, 3, 2)
        bounds = certified_distance((grids[0], grids[1]), points, (targets[0], targets[1]), fitted)
        bounds += _rounding(poles, centre, spaces)
        if poles.shape[-1] == 4:
            least = patches.poles[..., 3].min(axis=(1, 2))
            bounds[poles[..., 3].min(axis=(1, 2)) < _WEIGHT_SHARE * least] = np.inf
        reduced = TensorSplines(
            (first.degree, second.degree),
            (spaces[0][0], spaces[1][0]),
            (spaces[0][1], spaces[1][1]),
            poles,
        )
        return Reduced(rows, reduced, bounds)


def _moved(poles: Floats, shift: Floats) -> Floats:
    """Control points (m, nu, nv, 3 or 4) shifted by (m, 3)."""
    by = shift[:, None, None, :]
    if poles.shape[-1] == 3:
        return poles + by
    weights = poles[..., 3:]
    return np.concatenate([poles[..., :3] + weights * by, weights], axis=-1)


def _rounding(poles: Floats, centre: Floats, spaces: list[tuple[Floats, Ints]]) -> Floats:
    """(m,) bound of the rounding errors of control points and of knots over [0, 1]."""
    if poles.shape[-1] == 4:
        poles = poles[..., :3] / np.abs(poles[..., 3:])
    largest = np.abs(poles).max(axis=(1, 2, 3))
    reach = np.abs(poles - centre[:, None, None, :]).max(axis=(1, 2, 3))
    share = np.zeros(len(poles))
    for knots, mults in spaces:
        if len(mults) > 2:
            steps = np.diff(knots, axis=1).min(axis=1)
            share += int(mults[0]) * np.abs(knots).max(axis=1) / steps
    return np.asarray(8 * _ULP * (largest + share * reach))
