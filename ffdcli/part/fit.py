"""B-splines fitted to deformed surfaces and curves on their own parameters.

Knots start where the image is not smooth, as far as iso-lines follow that. Intervals whose error is
beyond the tolerance are divided, in the direction that the error comes from. All faces or edges of
a round are deformed at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import CheckError
from ffdcli.part.axis_fit import AxisFit, pieces_wanted
from ffdcli.part.fit_error import measure
from ffdcli.part.fit_target import (
    DENSITY,
    MEASURED_SHARE,
    Fit,
    Images,
    Target,
    along,
    deform_grids,
    join_sides,
    poles_of,
)

# Largest number of pieces that one round divides an interval into.
_MOST_PIECES = 4
# Rounds until a fit is given up, and the most control points of a face or an edge.
_MOST_ROUNDS = 40
_MOST_POLES = 100_000
# Points deformed at once.
_CHUNK = 1_000_000


def fit_all(
    targets: Sequence[Target], images: Images, tolerance: float, names: Sequence[str]
) -> tuple[Fit, ...]:
    """Fit all targets within a tolerance.

    Parameters
    ----------
    targets : sequence of Target
    images : callable
        The deformation of each target.
    tolerance : float, model length
        Largest bound of any fit.
    names : sequence of str
        What the targets are, for messages.

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
        asked = {number: (trial.target, trial.fit) for number, trial in ready.items()}
        for number, (fit, error) in zip(asked, measure(asked, images), strict=True):
            if fit.error <= allowed:
                done[number] = fit
            else:
                rest[number] = ready[number].divided(ready[number].pieces(error, allowed))
        pending = rest
        if not pending:
            return tuple(done[number] for number in range(len(targets)))
        for number, target in pending.items():
            if np.prod([axis.size for axis in target.axes]) > _MOST_POLES:
                raise _too_many(names[number], tolerance)
    raise _too_many(names[next(iter(pending))], tolerance)


def _too_many(name: str, tolerance: float) -> CheckError:
    message = f"{name} cannot be fitted within {tolerance:.3g} with {_MOST_POLES:,}"
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

    @property
    def fit(self) -> Fit:
        """The fit, with its error at the sites: peaks there may be missed by other points."""
        return Fit(self.target.axes, self.poles, float(self.error.max()), 0)

    def divided(self, pieces: list[Ints]) -> Target:
        """The target with more knots."""
        axes = (axis.split(each) for axis, each in zip(self.target.axes, pieces, strict=True))
        return replace(self.target, axes=tuple(axes))


def _solve(pending: dict[int, Target], images: Images) -> list[_Trial]:
    """Fit all targets with their present knots."""
    trials: list[_Trial] = []
    for group in _groups(pending):
        deformed = deform_grids([pending[number].grid for number in group], group, images)
        for number, values in zip(group, deformed, strict=True):
            trials.append(_fit_one(pending[number], values))
    return trials


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


def _fit_one(target: Target, values: Floats) -> _Trial:
    """Fit values on the sites of all axes."""
    join_sides(target, values)
    poles, fits = poles_of(target, values), target.fits
    approx, axis_errors = values, []
    for number, fit in enumerate(fits):
        alone = along(fit.smoothing, values, number)
        axis_errors.append(_by_cell(np.linalg.norm(values - alone, axis=-1), fits))
        approx = along(fit.smoothing, approx, number)
    error = _by_cell(np.linalg.norm(values - approx, axis=-1), fits) * target.cells
    return _Trial(target, poles, error, tuple(axis_errors))


def _by_cell(errors: Floats, fits: tuple[AxisFit, ...]) -> Floats:
    """Largest error in each cell, from errors at all sites."""
    for axis, fit in enumerate(fits):
        starts = np.flatnonzero(np.diff(fit.interval, prepend=-1))
        errors = np.maximum.reduceat(errors, starts, axis=axis)
    return errors
