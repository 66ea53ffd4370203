"""What is fitted: surfaces and curves over shares of their parameters, and how they are sampled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from ffdcli.arrays import Floats, Ints
from ffdcli.part.axis_fit import Axis, AxisFit, axis_fit
from ffdcli.part.outline import Outline

# A measured error is stated with a third added; so the fit keeps to this share of its tolerance.
MEASURED_SHARE = 0.75
# Sites along each axis in every interval, at least.
DENSITY = 3


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


def axis_fits(target: Target) -> list[AxisFit]:
    """The maps between sites and control points of all axes."""
    return [axis_fit(axis, max(DENSITY, axis.largest_share)) for axis in target.axes]


def open_grid(shares: Sequence[Floats]) -> list[Floats]:
    """Shares along each axis as arrays that broadcast to a grid."""
    return [
        each.reshape([-1 if a == axis else 1 for a in range(len(shares))])
        for axis, each in enumerate(shares)
    ]


def deform_grids(points: Sequence[Floats], numbers: Sequence[int], images: Images) -> list[Floats]:
    """Images of arrays of points (..., 3) of numbered targets, all at once."""
    every, owner = joined(points)
    found = parted(images(every, np.array(numbers, dtype=np.int64)[owner]), owner, len(points))
    return [part.reshape(each.shape) for part, each in zip(found, points, strict=True)]


def joined(points: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Arrays of points (..., 3) as one (n, 3), and the array (n,) of each."""
    flat = [each.reshape(-1, 3) for each in points]
    counts = np.array([len(each) for each in flat], dtype=np.int64)
    return np.concatenate([np.zeros((0, 3)), *flat]), np.repeat(np.arange(len(flat)), counts)


def parted(values: Floats, owner: Ints, count: int) -> list[Floats]:
    """Values (n, c) of rising owners (n,) as one array for each of a number of owners."""
    return np.split(values, np.searchsorted(owner, np.arange(1, count))) if count else []


def poles_of(target: Target, fits: list[AxisFit], values: Floats) -> Floats:
    """Control points from values on the sites of all axes."""
    for number, fit in enumerate(fits):
        values = along(fit.matrix, values, number)
    for number, axis in enumerate(target.axes):
        if axis.closed:
            sides = np.moveaxis(values, number, 0)
            sides[-1] = sides[0]
    join_sides(target, values)
    return values


def join_sides(target: Target, values: Floats) -> None:
    """Make sides of a grid (nu[, nv], 3) that meet equal to the bit, and sides that are a point."""
    for number, end in target.points:
        sides = np.moveaxis(values, number, 0)
        sides[-end] = sides[-end, 0]
    for number, axis in enumerate(target.axes):
        if axis.closed == "continuous":
            sides = np.moveaxis(values, number, 0)
            sides[-1] = sides[0]


def along(matrix: Floats, values: Floats, axis: int) -> Floats:
    """Multiply values (..., m, ...) along an axis by a matrix (n, m)."""
    moved = np.moveaxis(values, axis, 0)
    product = matrix @ moved.reshape(len(moved), -1)
    return np.moveaxis(product.reshape(len(matrix), *moved.shape[1:]), 0, axis)


def evaluate(axes: Sequence[Axis], poles: Floats, at: Floats) -> Floats:
    """Points (n, 3) of a fitted spline at shares (n, d)."""
    if len(axes) == 1:
        line: Floats = BSpline(axes[0].knots, poles, axes[0].degree)(at[:, 0])
        return line
    knots, degrees = tuple(axis.knots for axis in axes), tuple(axis.degree for axis in axes)
    sheet: Floats = NdBSpline(knots, np.ascontiguousarray(poles), degrees)(at)
    return sheet
