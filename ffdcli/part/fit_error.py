"""Errors of fits, measured at points that no fit has used."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.fit_target import Fit, Images, Target, deform_grids, evaluate
from ffdcli.part.outline import cell_of

# Places of these points, as shares of an interval: near a knot and off the sites. The least number
# of intervals that they are spread over along an axis of a face; edges have more.
_UNSEEN = np.array([0.0137, 0.43])
_LEAST_UNSEEN, _EDGE_UNSEEN = 6, 4
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
    first = _errors(fits, [unseen(target) for target, _ in fits.values()], images)
    closer = [
        _worst_cells(target, cells)
        for (target, _), (_, cells) in zip(fits.values(), first, strict=True)
    ]
    again = _errors(fits, closer, images)
    out = []
    for (_, fit), (count, cells), (more, peaks) in zip(fits.values(), first, again, strict=True):
        cells = np.maximum(cells, peaks)
        worst = float(max(cells.max(), fit.error))
        out.append((Fit(fit.axes, fit.poles, worst, count + more), cells))
    return out


def _errors(
    fits: dict[int, tuple[Target, Fit]], shares: list[Floats], images: Images
) -> list[tuple[int, Floats]]:
    """Number of points, and the largest error at them in each cell, for each fit."""
    pairs = list(zip(fits.values(), shares, strict=True))
    points = [target.place(*at.T) for (target, _), at in pairs]
    found = deform_grids(points, list(fits), images)
    out = []
    for ((_, fit), at), values in zip(pairs, found, strict=True):
        errors = np.linalg.norm(values - evaluate(fit.axes, fit.poles, at), axis=-1)
        cells = np.zeros([axis.interval_count for axis in fit.axes])
        index = tuple(cell_of(axis.breaks, at[:, a]) for a, axis in enumerate(fit.axes))
        np.maximum.at(cells, index, errors)
        out.append((len(at), cells))
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
