"""What is fitted: surfaces and curves over shares of their parameters, and how they are sampled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, NdBSpline
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.part.axis_fit import Axis, AxisFit, axis_fit
from ffdcli.part.outline import Outline

# A measured error is stated with a third added; so the fit keeps to this share of its tolerance.
MEASURED_SHARE = 0.75
# Sites along each axis in every interval, at least.
DENSITY = 3
# Places of points that no fit has used, as shares of an interval: near a knot and off the sites.
# The least number of intervals that they are spread over along an axis of a face; edges have more.
_UNSEEN = np.array([0.0137, 0.43])
_LEAST_UNSEEN, _EDGE_UNSEEN = 6, 4


@dataclass(frozen=True, eq=False)
class Target:
    """A surface or curve to be fitted after its deformation, over shares of its parameters.

    What is sampled of it does not depend on the deformation, and is kept.

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

    @cached_property
    def fits(self) -> tuple[AxisFit, ...]:
        """The maps between sites and control points of all axes."""
        return tuple(axis_fit(axis, max(DENSITY, axis.largest_share)) for axis in self.axes)

    @cached_property
    def grid(self) -> Floats:
        """Undeformed points (m, 3) or (mu, mv, 3) at the sites."""
        return self.place(*open_grid([fit.sites for fit in self.fits]))

    @cached_property
    def cells(self) -> Bools:
        """(iu[, iv]) True for cells between knots whose errors count."""
        if self.outline is None:
            return np.ones([axis.interval_count for axis in self.axes], dtype=bool)
        return self.outline.cells(*(np.array(axis.breaks) for axis in self.axes))

    @cached_property
    def unseen(self) -> Floats:
        """Shares (n, d) of points off the sites: in every cell, and on the outline of a face."""
        shares = []
        for axis in self.axes:
            breaks = np.array(axis.breaks)
            finer = -(-_LEAST_UNSEEN // axis.interval_count)
            finer = max(finer, _EDGE_UNSEEN) if self.outline is None else finer
            steps = (np.arange(finer)[:, None] + _UNSEEN).ravel() / finer
            shares.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel())
        if self.outline is None:
            return np.stack(np.meshgrid(*shares, indexing="ij"), axis=-1).reshape(-1, len(shares))
        inner = np.argwhere(self.outline.inside(shares[0], shares[1]))
        grid = np.stack([each[inner[:, a]] for a, each in enumerate(shares)], axis=1)
        return np.concatenate([grid, self.outline.starts])

    @cached_property
    def unseen_points(self) -> Floats:
        """Undeformed points (n, 3) at the unseen shares."""
        return self.place(*self.unseen.T)

    @cached_property
    def unseen_basis(self) -> csr_array:
        """(n, p) from control points to the fit at the unseen shares."""
        if len(self.axes) == 1:
            return BSpline.design_matrix(self.unseen[:, 0], self.axes[0].knots, self.axes[0].degree)
        knots, degrees = zip(*((axis.knots, axis.degree) for axis in self.axes), strict=True)
        out = NdBSpline.design_matrix(self.unseen, knots, degrees)
        # It ends with the last control point that counts.
        out.resize(len(self.unseen), np.prod([axis.size for axis in self.axes]))
        return out

    def at_unseen(self, poles: Floats) -> Floats:
        """Points (n, c) at the unseen shares, from control points (p, c) or (pu, pv, c)."""
        found: Floats = self.unseen_basis @ poles.reshape(-1, poles.shape[-1])
        return found


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


def poles_of(target: Target, values: Floats) -> Floats:
    """Control points from values on the sites of all axes."""
    for number, fit in enumerate(target.fits):
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
    """Multiply values (m, c) or (m0, m1, c) along an axis by a matrix (n, m)."""
    if axis:
        return matrix @ values
    return (matrix @ values.reshape(len(values), -1)).reshape(len(matrix), *values.shape[1:])


def evaluate(axes: Sequence[Axis], poles: Floats, at: Floats) -> Floats:
    """Points (n, 3) of a fitted spline at shares (n, d)."""
    if len(axes) == 1:
        line: Floats = BSpline(axes[0].knots, poles, axes[0].degree)(at[:, 0])
        return line
    knots, degrees = tuple(axis.knots for axis in axes), tuple(axis.degree for axis in axes)
    sheet: Floats = NdBSpline(knots, np.ascontiguousarray(poles), degrees)(at)
    return sheet
