"""Splines of one direction over [0, 1], fitted to values at sites by least squares.

The maps depend on the knots alone. Parameters are shares of a face's rectangle or of an edge's
range, and knots come from halving, so that many faces have the same: the maps are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class Axis:
    """Knots of one direction of a fit.

    Parameters
    ----------
    degree : int
    breaks : tuple of float
        Distinct knots, from 0 to 1.
    mults : tuple of int
        Multiplicities of the inner ones.
    closed : {"", "continuous", "smooth"}
        Whether the values at 1 are those at 0, and the derivatives.
    """

    degree: int
    breaks: tuple[float, ...]
    mults: tuple[int, ...]
    closed: str = ""

    @cached_property
    def knots(self) -> Floats:
        """All knots, the end ones ``degree + 1`` times."""
        ends = self.degree + 1
        return np.repeat(self.breaks, (ends, *self.mults, ends))

    @property
    def size(self) -> int:
        """Number of control points."""
        return sum(self.mults) + self.degree + 1

    @property
    def interval_count(self) -> int:
        """Number of intervals between knots."""
        return len(self.breaks) - 1

    @property
    def largest_share(self) -> int:
        """Control points that stand in one interval at most; half of those of each of its knots."""
        mults = np.array([self.degree, *self.mults, self.degree])
        return int(np.ceil((mults[1:] + mults[:-1]).max() / 2))

    def split(self, pieces: Ints) -> Axis:
        """Divide every interval into a number (n,) of equal pieces by single knots."""
        breaks, mults = [self.breaks[0]], []
        for i, count in enumerate(pieces.tolist()):
            low, high = self.breaks[i : i + 2]
            breaks += [low + (high - low) * k / count for k in range(1, count)]
            mults += [1] * (count - 1)
            breaks.append(high)
            mults += self.mults[i : i + 1]
        return Axis(self.degree, tuple(breaks), tuple(mults), self.closed)


@dataclass(frozen=True)
class AxisFit:
    """Maps between values at sites and control points.

    Parameters
    ----------
    sites : (m,) float64
        The same number in every interval; both ends too, unless the axis is smoothly closed.
    interval : (m,) int64
        The interval of each site.
    matrix : (n, m) float64
        From values at sites to control points.
    values : (m, n) float64
        From control points to values at sites.
    """

    sites: Floats
    interval: Ints
    matrix: Floats
    values: Floats

    @cached_property
    def smoothing(self) -> Floats:
        """(m, m) from values at sites to those of the fit there."""
        return self.values @ self.matrix


@lru_cache(maxsize=512)
def axis_fit(axis: Axis, density: int) -> AxisFit:
    """The fit with ``density`` sites in every interval.

    Least squares; the ends are interpolated, so that the sides of a patch depend on the values
    there alone. A smoothly closed axis is fitted by a periodic spline.
    """
    angles = (np.arange(density) + 0.5) * (np.pi / density)
    shares = (1 - np.cos(angles)) / 2
    breaks = np.array(axis.breaks)
    inner = (breaks[:-1, None] + np.diff(breaks)[:, None] * shares).ravel()
    interval = np.repeat(np.arange(axis.interval_count), density)
    knots, degree = axis.knots, axis.degree
    if axis.closed == "smooth":
        expand, around = _periodic(axis)
        values = _design(around, degree, inner) @ expand
        matrix = _clamp(axis, around) @ expand @ _least_squares(values)
        return _frozen(inner, interval, matrix, _design(knots, degree, inner))
    sites = np.concatenate([[0.0], inner, [1.0]])
    interval = np.concatenate([[0], interval, [axis.interval_count - 1]])
    values = _design(knots, degree, sites)
    matrix = np.zeros((axis.size, len(sites)))
    matrix[0, 0] = matrix[-1, -1] = 1.0
    if axis.size > 2:
        free, fixed = values[1:-1, 1:-1], values[1:-1, [0, -1]]
        solve = _least_squares(free)
        matrix[1:-1, 1:-1] = solve
        matrix[1:-1, [0, -1]] = -solve @ fixed
    return _frozen(sites, interval, matrix, values)


def _least_squares(values: Floats) -> Floats:
    """(n, m) matrix to the least-squares solution of a system (m, n) of full rank."""
    q, r = np.linalg.qr(values)
    out: Floats = solve_triangular(r, q.T)
    return out


def _design(knots: Floats, degree: int, sites: Floats) -> Floats:
    """(m, n) values of all basis functions at sites."""
    out: Floats = BSpline.design_matrix(sites, knots, degree).toarray()
    return out


def _periodic(axis: Axis) -> tuple[Floats, Floats]:
    """Map (n + degree, n) from a period's coefficients to all that reach [0, 1]; their knots."""
    once = np.repeat(axis.breaks[:-1], (1, *axis.mults))
    count, degree = len(once), axis.degree
    index = np.arange(-degree, count + degree + 1)
    knots: Floats = once[index % count] + np.floor_divide(index, count)
    expand = np.zeros((count + degree, count))
    expand[np.arange(count + degree), np.arange(count + degree) % count] = 1.0
    return expand, knots


def _clamp(axis: Axis, around: Floats) -> Floats:
    """Map from coefficients over the knots ``around`` to control points over those of the axis."""
    knots, degree = axis.knots, axis.degree
    windows = np.lib.stride_tricks.sliding_window_view(knots, degree)[1 : axis.size + 1]
    sites = windows.mean(axis=1)
    values = _design(around, degree, sites)
    return np.asarray(np.linalg.solve(_design(knots, degree, sites), values), dtype=np.float64)


def _frozen(sites: Floats, interval: Ints, matrix: Floats, values: Floats) -> AxisFit:
    for each in (sites, interval, matrix, values):
        each.flags.writeable = False
    return AxisFit(sites, interval, matrix, values)


def pieces_wanted(errors: Floats, allowed: float, degree: int, most: int) -> Ints:
    """Pieces (n,) into which intervals with errors (n,) should be divided to be within a bound.

    The error of a spline falls with the power ``degree + 1`` of the length.
    """
    ratio = np.maximum(errors / allowed, 0.0)
    wanted = np.ceil(ratio ** (1 / (degree + 1)) * (1 - 1e-9)).astype(np.int64)
    return np.where(ratio > 1, np.clip(wanted, 2, most), 1)
