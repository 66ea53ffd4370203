"""Fewer control points within a certified bound: lower degrees, fewer knots, capped degrees.

Every patch gets the smallest of many spaces whose bound holds. Estimates say which spaces are
worth trying: along each direction, what a fit loses at sites (root mean square, hence less than the
largest error). Then least squares in both directions, and the bound of :mod:`.reduce_bound`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.spline_spaces import Grid, project
from ffdcli.surface.reduce.bound import certified_distance, on_both
from ffdcli.surface.reduce.candidates import Direction, Level, direction

# Patches looked at together, by their control points' numbers.
_CHUNK_NUMBERS = 200_000
# A level loses so little that the next larger one need not be tried.
_PLENTY = 0.1
# Share of the ratio of bound to estimate that other levels of the same patch are taken to have.
_ALIKE = 0.7
# Reduced weights keep at least this share of the least one.
_WEIGHT_SHARE = 0.1
# The patches' own cells.
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
        """The chosen patches alone."""
        knots = (self.knots[0][rows], self.knots[1][rows])
        return replace(self, knots=knots, poles=self.poles[rows])


@dataclass(frozen=True)
class Reduced:
    """Patches after reduction.

    Parameters
    ----------
    rows : (n,) int64
        Which of the patches given these are.
    patches : TensorSplines
    bounds : (n,) float64, model length
        Certified distance from the patches given, parameter by parameter; 0 where unchanged.
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
    """Write every patch with as few control points as its tolerance allows.

    Parameters
    ----------
    patches : TensorSplines
    tolerances : (m,) float64, model length
    step : float, model length
        New control points are multiples of it (short to write), which the bounds allow for.
    max_degree : int, optional
        No degree may be higher. Where the tolerance is not met at lower degrees, spans are
        divided; where even that does not help, the bounds are larger than the tolerances.
    keep_ends : bool
        Keep the first and last control points along u (for curves that meet at vertices).

    Returns
    -------
    list of Reduced
        Which together hold every patch once.

    Notes
    -----
    Least squares at Chebyshev sites: on a single span that is the truncated Chebyshev series.
    The bound is that of the hull of the difference, see Farouki and Rajan 1988 for the Bernstein
    form's numerical behaviour.
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
    """The state that all tries on some patches share.

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
                direction(patches.degrees[axis], patches.knots[axis], patches.mults[axis], along)
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
        """Yield all patches, reduced, group by group."""
        losses = [self._losses(axis) for axis in range(2)]
        flat = [[level for ladder in ladders for level in ladder] for ladders in self.levels]
        sizes = [np.array([self._size(axis, x) for x in flat[axis]]) for axis in range(2)]
        cost = np.multiply.outer(*sizes)
        lost = np.hypot(losses[0][:, :, None], losses[1][:, None, :]).reshape(len(self.points), -1)
        rank = np.argsort(cost.ravel(), kind="stable")
        if not self.capped:
            # The patch itself is the last pair; those that are no smaller are of no use.
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
            # Where nothing is left to try, the least lossy space has to do.
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
        _, mults = self.directions[axis].take(np.zeros(1, dtype=np.int64)).written(level)
        return int(mults.sum()) - level.degree - 1

    def _losses(self, axis: int) -> Floats:
        """(m, levels) root mean square of what each level loses along one direction.

        Infinite where that is known to be too much, or was not looked at because a smaller space
        of the same degree is more than good enough.
        """
        out = []
        everything = np.arange(len(self.points))
        for ladder in self.levels[axis]:
            open_still = everything
            for level in ladder:
                lost = np.full(len(everything), np.inf)
                if level.exact:
                    lost[:] = 0.0
                elif len(open_still):
                    lost[open_still] = self._loss(axis, level, open_still)
                    enough = lost[open_still] <= _PLENTY * self.tolerances[open_still]
                    open_still = open_still[~enough]
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
        """Fit patches in a pair of levels, with the bound of what that loses."""
        patches = self.patches.take(rows)
        if first.exact and second.exact:
            return Reduced(rows, patches, np.zeros(len(rows)))
        matrices, written, grids, targets = [], [], [], []
        for axis, level in enumerate((first, second)):
            this = self.directions[axis].take(rows)
            grids.append(self._grid(axis, level, rows))
            targets.append(this.target(level))
            written.append(this.written(level))
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
        # Judged are the numbers that are written.
        fitted = _moved(poles, -centre).transpose(0, 1, 3, 2)
        bounds = certified_distance((grids[0], grids[1]), points, (targets[0], targets[1]), fitted)
        bounds += _rounding(poles, centre, written)
        if poles.shape[-1] == 4:
            least = patches.poles[..., 3].min(axis=(1, 2))
            bounds[poles[..., 3].min(axis=(1, 2)) < _WEIGHT_SHARE * least] = np.inf
        reduced = TensorSplines(
            (first.degree, second.degree),
            (written[0][0], written[1][0]),
            (written[0][1], written[1][1]),
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


def _rounding(poles: Floats, centre: Floats, written: list[tuple[Floats, Ints]]) -> Floats:
    """(m,) what the rounding of control points and of knots over [0, 1] may add."""
    if poles.shape[-1] == 4:
        poles = poles[..., :3] / np.abs(poles[..., 3:])
    largest = np.abs(poles).max(axis=(1, 2, 3))
    reach = np.abs(poles - centre[:, None, None, :]).max(axis=(1, 2, 3))
    share = np.zeros(len(poles))
    for knots, mults in written:
        if len(mults) > 2:
            steps = np.diff(knots, axis=1).min(axis=1)
            share += int(mults[0]) * np.abs(knots).max(axis=1) / steps
    return np.asarray(8 * _ULP * (largest + share * reach))
