"""B-splines fitted to deformed surfaces and curves on their own parameters.

Knots start where the image is not smooth, as far as iso-lines follow that. Intervals whose error is
beyond the tolerance are divided, in the direction that the error comes from. All faces or edges of
a round are deformed at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import CheckError
from ffdcli.part.axis_fit import Axis, AxisFit, axis_fit, pieces_wanted
from ffdcli.part.outline import Outline, cell_of

# A measured error is stated with a third added; so the fit keeps to this share of its tolerance.
MEASURED_SHARE = 0.75
# Sites along each axis in every interval.
DENSITY = 3
# Places of the points that no fit has seen, as shares of an interval: near a knot and off the
# sites. The least number of intervals that they are spread
# over along an axis of a face; edges have more.
_UNSEEN = np.array([0.0137, 0.31, 0.74])
_LEAST_UNSEEN, _EDGE_UNSEEN = 6, 4
# Largest number of pieces that one round divides an interval into.
_MOST_PIECES = 4
# Rounds until a fit is given up, and the most control points of a face or an edge.
_MOST_ROUNDS = 40
_MOST_POLES = 50_000
# Points deformed at once.
_CHUNK = 1_000_000


@dataclass(frozen=True, eq=False)
class Target:
    """A surface or curve to be fitted after its deformation, over shares of its parameters.

    Parameters
    ----------
    place : callable
        Undeformed points (..., 3) at one array of shares per axis, which broadcast to (...).
    axes : one or two Axis
        The knots to start with.
    outline : Outline or None
        Of a face; errors outside of it do not count.
    points : tuple of (int, int)
        Sides, as axis and end, that are one point.
    """

    place: Callable[..., Floats]
    axes: tuple[Axis, ...]
    outline: Outline | None = None
    points: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted B-spline over shares of the parameters.

    Parameters
    ----------
    axes : one or two Axis
    poles : (n, 3) or (nu, nv, 3) float64, model length
    error : float, model length
        Largest distance found at points that the fit has not used.
    samples : int
        Number of these points.
    """

    axes: tuple[Axis, ...]
    poles: Floats
    error: float
    samples: int

    @property
    def bound(self) -> float:
        """The stated bound: the largest distance found and a third."""
        return self.error / MEASURED_SHARE


# Images (n, 3) of points (n, 3), which belong to targets (n,).
Images = Callable[[Floats, Ints], Floats]


def fit_all(
    targets: Sequence[Target], images: Images, tolerance: float, name: str, numbers: Ints
) -> tuple[Fit, ...]:
    """Fit all targets within a tolerance.

    Parameters
    ----------
    targets : sequence of Target
    images : callable
        The deformation of each target.
    tolerance : float, model length
        Largest bound of any fit.
    name : str
        What the targets are, for messages.
    numbers : (n,) int64
        Their numbers, for messages.

    Raises
    ------
    CheckError
        A fit does not come within the tolerance.
    """
    allowed = MEASURED_SHARE * tolerance
    done: dict[int, Fit] = {}
    pending = dict(enumerate(targets))
    for _ in range(_MOST_ROUNDS):
        tried = dict(zip(pending, _solve(pending, images), strict=True))
        rest: dict[int, Target] = {}
        ready: dict[int, _Trial] = {}
        for number, trial in tried.items():
            pieces = trial.pieces(trial.error, allowed)
            if any((each > 1).any() for each in pieces):
                rest[number] = trial.divided(pieces)
            else:
                ready[number] = trial
        for number, fit, error in _check(ready, images):
            trial = ready[number]
            if fit.error <= allowed:
                done[number] = fit
            else:
                rest[number] = trial.divided(trial.pieces(error, allowed))
        pending = rest
        if not pending:
            return tuple(done[number] for number in range(len(targets)))
        for number, target in pending.items():
            if np.prod([axis.size for axis in target.axes]) > _MOST_POLES:
                raise _too_many(name, int(numbers[number]), tolerance)
    raise _too_many(name, int(numbers[next(iter(pending))]), tolerance)


def _too_many(name: str, number: int, tolerance: float) -> CheckError:
    message = f"{name} {number} cannot be fitted within {tolerance:.3g} with {_MOST_POLES:,}"
    hint = "give a larger --fit-tolerance, or a smoother lattice: a higher degree, or `border: c2`"
    return CheckError(f"{message} control points", hint=hint)


@dataclass(frozen=True, eq=False)
class _Trial:
    """One target fitted with its present knots.

    Parameters
    ----------
    target : Target
    poles : (nu[, nv], 3) float64
    error : (iu[, iv]) float64
        Largest error in each cell that counts.
    axis_errors : as error, one for each axis
        Largest errors if the image were fitted along that axis alone.
    """

    target: Target
    poles: Floats
    error: Floats
    axis_errors: tuple[Floats, ...]

    def pieces(self, error: Floats, allowed: float) -> list[Ints]:
        """Pieces into which the intervals of each axis should be divided for cells' errors."""
        over = error > allowed
        largest = np.max(self.axis_errors, axis=0)
        out = []
        for number, (axis, mine) in enumerate(zip(self.target.axes, self.axis_errors, strict=True)):
            # What was found beyond the sites is shared out as at the sites.
            share = np.divide(mine, largest, out=np.ones_like(mine), where=largest > 0)
            helps = over & (share >= 0.5)
            found = np.where(helps, error * share, 0.0)
            others = tuple(a for a in range(found.ndim) if a != number)
            worst = found.max(axis=others)
            pieces = pieces_wanted(worst, allowed, axis.degree, _MOST_PIECES)
            pieces[(pieces < 2) & helps.any(axis=others)] = 2
            out.append(pieces)
        return out

    def divided(self, pieces: list[Ints]) -> Target:
        """The target with more knots."""
        axes = (axis.split(each) for axis, each in zip(self.target.axes, pieces, strict=True))
        return replace(self.target, axes=tuple(axes))


def _solve(pending: dict[int, Target], images: Images) -> list[_Trial]:
    """Fit all targets with their present knots."""
    trials: list[_Trial] = []
    for group in _groups(pending):
        sampled = []
        for number in group:
            target = pending[number]
            fits = axis_fits(target)
            points = target.place(*open_grid([fit.sites for fit in fits]))
            sampled.append((number, fits, points))
        deformed = _deform([(number, points) for number, _, points in sampled], images)
        for (number, fits, _), values in zip(sampled, deformed, strict=True):
            trials.append(_fit_one(pending[number], fits, values))
    return trials


def axis_fits(target: Target) -> list[AxisFit]:
    """The maps between sites and control points of all axes."""
    return [axis_fit(axis, max(DENSITY, axis.degree)) for axis in target.axes]


def _groups(pending: dict[int, Target]) -> list[list[int]]:
    """Numbers of targets in groups that are sampled together."""
    groups: list[list[int]] = []
    size = _CHUNK
    for number, target in pending.items():
        count = int(np.prod([axis.interval_count * DENSITY + 2 for axis in target.axes]))
        if size + count > _CHUNK:
            groups.append([])
            size = 0
        groups[-1].append(number)
        size += count
    return groups


def open_grid(shares: Sequence[Floats]) -> list[Floats]:
    """Shares along each axis as arrays that broadcast to a grid."""
    return [
        each.reshape([-1 if a == axis else 1 for a in range(len(shares))])
        for axis, each in enumerate(shares)
    ]


def _deform(sampled: Sequence[tuple[int, Floats]], images: Images) -> list[Floats]:
    """Images of points (..., 3) of numbered targets, all at once."""
    points, owner = joined([points for _, points in sampled])
    numbers = np.array([number for number, _ in sampled], dtype=np.int64)
    found = parted(images(points, numbers[owner]), owner)
    return [part.reshape(each.shape) for part, (_, each) in zip(found, sampled, strict=True)]


def joined(points: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Arrays of points (..., 3) as one (n, 3), and the array (n,) of each."""
    flat = [each.reshape(-1, 3) for each in points]
    counts = np.array([len(each) for each in flat], dtype=np.int64)
    return np.concatenate([np.zeros((0, 3)), *flat]), np.repeat(np.arange(len(flat)), counts)


def parted(values: Floats, owner: Ints) -> list[Floats]:
    """Values (n, c) of rising owners (n,), which all have some, as one array for each."""
    return np.split(values, np.flatnonzero(np.diff(owner)) + 1) if len(owner) else []


def _fit_one(target: Target, fits: list[AxisFit], values: Floats) -> _Trial:
    """Fit values on the sites of all axes."""
    _join_sides(target, values)
    poles = poles_of(target, fits, values)
    approx, axis_errors = values, []
    for number, fit in enumerate(fits):
        both = fit.values @ fit.matrix
        alone = along(both, values, number)
        axis_errors.append(_by_cell(np.linalg.norm(values - alone, axis=-1), fits))
        approx = along(both, approx, number)
    error = _by_cell(np.linalg.norm(values - approx, axis=-1), fits)
    if target.outline is not None:
        error *= target.outline.cells(*(np.array(axis.breaks) for axis in target.axes))
    return _Trial(target, poles, error, tuple(axis_errors))


def poles_of(target: Target, fits: list[AxisFit], values: Floats) -> Floats:
    """Control points from values on the sites of all axes."""
    for number, fit in enumerate(fits):
        values = along(fit.matrix, values, number)
    for number, axis in enumerate(target.axes):
        if axis.closed:
            sides = np.moveaxis(values, number, 0)
            sides[-1] = sides[0]
    _join_sides(target, values)
    return values


def along(matrix: Floats, values: Floats, axis: int) -> Floats:
    """Multiply values (..., m, ...) along an axis by a matrix (n, m)."""
    moved = np.moveaxis(values, axis, 0)
    product = matrix @ moved.reshape(len(moved), -1)
    return np.moveaxis(product.reshape(len(matrix), *moved.shape[1:]), 0, axis)


def _join_sides(target: Target, values: Floats) -> None:
    """Make sides of a grid (nu[, nv], 3) that meet equal to the bit, and sides that are a point."""
    for number, end in target.points:
        sides = np.moveaxis(values, number, 0)
        sides[-end] = sides[-end, 0]
    for number, axis in enumerate(target.axes):
        if axis.closed == "continuous":
            sides = np.moveaxis(values, number, 0)
            sides[-1] = sides[0]


def _by_cell(errors: Floats, fits: list[AxisFit]) -> Floats:
    """Largest error in each cell, from errors at all sites."""
    for axis, fit in enumerate(fits):
        starts = np.flatnonzero(np.diff(fit.interval, prepend=-1))
        errors = np.maximum.reduceat(errors, starts, axis=axis)
    return errors


def _check(ready: dict[int, _Trial], images: Images) -> list[tuple[int, Fit, Floats]]:
    """Each fit with its error at points that it has not used, and the errors of its cells."""
    shares = [unseen(trial.target) for trial in ready.values()]
    pairs = list(zip(ready.values(), shares, strict=True))
    points = [trial.target.place(*at.T) for trial, at in pairs]
    deformed = _deform(list(zip(ready, points, strict=True)), images)
    out = []
    for (number, trial), at, values in zip(ready.items(), shares, deformed, strict=True):
        axes = trial.target.axes
        errors = np.linalg.norm(values - evaluate(axes, trial.poles, at), axis=-1)
        cells = np.zeros(trial.error.shape)
        index = tuple(cell_of(axis.breaks, at[:, a]) for a, axis in enumerate(axes))
        np.maximum.at(cells, index, errors)
        # Errors at the sites count too: they are the largest where the points miss a peak.
        worst = float(max(errors.max(initial=0.0), trial.error.max()))
        fit = Fit(axes, trial.poles, worst, len(errors))
        out.append((number, fit, cells))
    return out


def unseen(target: Target) -> Floats:
    """Shares (n, d) of points between the sites: in every cell, and on the outline of a face."""
    shares = []
    for axis in target.axes:
        breaks = np.array(axis.breaks)
        finer = -(-_LEAST_UNSEEN // axis.interval_count)
        finer = max(finer, _EDGE_UNSEEN) if target.outline is None else finer
        steps = (np.arange(finer)[:, None] + _UNSEEN).ravel() / finer
        shares.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel())
    if target.outline is None:
        return np.stack(np.meshgrid(*shares, indexing="ij"), axis=-1).reshape(-1, len(shares))
    inner = np.argwhere(target.outline.inside(shares[0], shares[1]))
    grid = np.stack([each[inner[:, a]] for a, each in enumerate(shares)], axis=1)
    return np.concatenate([grid, target.outline.starts])


def evaluate(axes: Sequence[Axis], poles: Floats, at: Floats) -> Floats:
    """Points (n, 3) of a fitted spline at shares (n, d)."""
    if len(axes) == 1:
        line: Floats = BSpline(axes[0].knots, poles, axes[0].degree)(at[:, 0])
        return line
    knots, degrees = tuple(axis.knots for axis in axes), tuple(axis.degree for axis in axes)
    sheet: Floats = NdBSpline(knots, np.ascontiguousarray(poles), degrees)(at)
    return sheet
