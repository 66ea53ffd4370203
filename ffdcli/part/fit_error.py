"""Errors of fits, measured at points that no fit has used."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.fit_target import Fit, Images, Target, deform_grids, evaluate
from ffdcli.part.outline import cell_of

# Cells whose error comes near the largest are looked at again: so many, at so many points an axis.
_NEAR, _MOST_CELLS, _AGAIN = 0.4, 40, 7


def measure(fits: dict[int, tuple[Target, Fit]], images: Images) -> list[tuple[Fit, Floats]]:
    """Fits with their errors, and the largest error in each cell.

    Parameters
    ----------
    fits : dict of int to (Target, Fit)
        By the number of the target.
    images : callable
        The deformation of each target.
    """
    targets = [target for target, _ in fits.values()]
    seen = [target.at_unseen(fit.poles) for target, fit in fits.values()]
    places = [(target.unseen, target.unseen_points) for target in targets]
    first = _errors(targets, list(fits), places, seen, images)
    closer = [_worst_cells(target, cells) for target, cells in zip(targets, first, strict=True)]
    seen = [
        evaluate(fit.axes, fit.poles, at)
        for (_, fit), at in zip(fits.values(), closer, strict=True)
    ]
    places = [(at, target.place(*at.T)) for target, at in zip(targets, closer, strict=True)]
    again = _errors(targets, list(fits), places, seen, images)
    out = []
    for (target, fit), at, cells, peaks in zip(fits.values(), closer, first, again, strict=True):
        cells = np.maximum(cells, peaks)
        worst = float(max(cells.max(), fit.error))
        out.append((Fit(fit.axes, fit.poles, worst, len(target.unseen) + len(at)), cells))
    return out


def _errors(
    targets: list[Target],
    numbers: list[int],
    places: list[tuple[Floats, Floats]],
    seen: list[Floats],
    images: Images,
) -> list[Floats]:
    """The largest error in each cell of every target.

    Parameters
    ----------
    places : list of ((n, d), (n, 3) float64)
        Shares, and the undeformed points there.
    seen : list of (n, 3) float64
        Points of the fits there.
    """
    found = deform_grids([points for _, points in places], numbers, images)
    out = []
    for target, (at, _), fitted, values in zip(targets, places, seen, found, strict=True):
        errors = np.linalg.norm(values - fitted, axis=-1)
        cells = np.zeros([axis.interval_count for axis in target.axes])
        index = tuple(cell_of(axis.breaks, at[:, a]) for a, axis in enumerate(target.axes))
        np.maximum.at(cells, index, errors)
        out.append(cells)
    return out


def _worst_cells(target: Target, errors: Floats) -> Floats:
    """Shares (n, d) of more points in the cells where errors come near the largest."""
    order = np.argsort(errors, axis=None)[::-1][:_MOST_CELLS]
    chosen = order[errors.ravel()[order] >= _NEAR * errors.max()]
    places = np.unravel_index(chosen, errors.shape)
    steps = (np.arange(_AGAIN) + 0.5) / _AGAIN
    shares = []
    for axis, place in zip(target.axes, places, strict=True):
        breaks = np.array(axis.breaks)
        shares.append(breaks[place][:, None] + (breaks[place + 1] - breaks[place])[:, None] * steps)
    if target.outline is None:
        return shares[0].reshape(-1, 1)
    grid = [np.repeat(shares[0], _AGAIN, axis=1), np.tile(shares[1], _AGAIN)]
    at = np.stack(grid, axis=-1).reshape(-1, 2)
    return at[target.outline.holds(at)]
