"""What is to be fitted: surfaces and curves over shares of their parameters, with first knots."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.axis_fit import Axis
from ffdcli.part.breaks import Planes, breaks_along
from ffdcli.part.curves import BSplineCurve, Curve
from ffdcli.part.fit_target import Fit, Target
from ffdcli.part.outline import Outline
from ffdcli.part.surfaces import BSplineSurface, Surface
from ffdcli.splines.knots import KnotPlanes

Closed = Literal["", "continuous", "smooth"]

# Sides that keep within this share of the size from each other, or from one point, are joined.
_JOINED = 1e-9
# Relative difference of derivatives across a closed side that counts as none.
_SMOOTH = 1e-6
# Shares along a side at which it is looked at.
_SIDE = np.linspace(0, 1, 33)
# Knots closer than this share of the parameters are one.
_ONE_KNOT = 1e-9
# Least number of intervals of a smoothly closed axis.
_ROUND = 4


def surface_target(
    surface: Surface,
    rectangle: Floats,
    outline: Outline,
    planes: tuple[Planes, ...],
    size: float,
    degrees: tuple[int, int],
) -> Target:
    """The target of a face.

    Parameters
    ----------
    surface : Surface
    rectangle : (2, 2) float64
        Parameters that the face reaches.
    outline : Outline
    planes : tuple of Planes
        Where the deformation is not smooth.
    size : float, model length
        Size of the part.
    degrees : (int, int)
    """
    low, extent = rectangle[0], rectangle[1] - rectangle[0]

    def place(u: Floats, v: Floats) -> Floats:
        return surface.points(low[0] + u * extent[0], low[1] + v * extent[1])

    axes, points = [], []
    for axis in range(2):

        def along(at: Floats, across: Floats, axis: int = axis) -> Floats:
            if axis:
                return np.swapaxes(place(across[:, None], at[None]), 0, 1)
            return place(at[:, None], across[None])

        sides = along(np.array([0.0, 1.0]), _SIDE)
        points += [
            (axis, end) for end in (0, 1) if np.ptp(sides[end], axis=0).max() <= _JOINED * size
        ]
        joined = np.abs(sides[1] - sides[0]).max() <= _JOINED * size
        own = surface.breaks(axis, rectangle[0, axis], rectangle[1, axis])
        own = KnotPlanes((own.values - low[axis]) / extent[axis], own.continuity)
        known = _merge(own, breaks_along(along, planes, size))
        smooth = (
            joined and _meets_smoothly(surface, rectangle, axis) and _end_free(known, degrees[axis])
        )
        closed: Closed = "smooth" if smooth else "continuous" if joined else ""
        axes.append(_axis(known, closed, degrees[axis]))
    return Target(place, tuple(axes), outline, tuple(points))


def curve_target(
    curve: Curve, ends: Floats, planes: tuple[Planes, ...], size: float, degree: int
) -> Target:
    """The target of an edge over its range ``ends`` (2,)."""
    low, extent = ends[0], ends[1] - ends[0]

    def place(t: Floats) -> Floats:
        return curve.points(low + t * extent)

    def along(at: Floats, across: Floats) -> Floats:
        points = place(at)[:, None]
        return np.broadcast_to(points, (len(at), len(across), 3))

    own = curve.breaks(ends[0], ends[1])
    own = KnotPlanes((own.values - low) / extent, own.continuity)
    known = _merge(own, breaks_along(along, planes, size))
    gap = place(np.array([0.0, 1.0]))
    joined = np.abs(gap[1] - gap[0]).max() <= _JOINED * size
    return Target(place, (_axis(known, "continuous" if joined else "", degree),))


def fitted_surface(fit: Fit, rectangle: Floats) -> BSplineSurface:
    """The B-spline of a fit over the parameters of its face."""
    knots = [_scaled(axis, rectangle[:, number]) for number, axis in enumerate(fit.axes)]
    degrees = fit.axes[0].degree, fit.axes[1].degree
    poles, weights = _divided(fit.poles)
    return BSplineSurface(degrees, (knots[0], knots[1]), poles, weights)


def fitted_curve(fit: Fit, ends: Floats) -> BSplineCurve:
    """The B-spline of a fit over the range of its edge."""
    poles, weights = _divided(fit.poles)
    return BSplineCurve(fit.axes[0].degree, _scaled(fit.axes[0], ends), poles, weights)


def _divided(poles: Floats) -> tuple[Floats, Floats | None]:
    """Control points (..., 3) and weights (...) of homogeneous points (..., 4)."""
    if poles.shape[-1] == 3:
        return poles, None
    return poles[..., :3] / poles[..., 3:], poles[..., 3]


def _scaled(axis: Axis, ends: Floats) -> Floats:
    """Knots over the range between two ends, which they begin and end with to the bit."""
    knots = axis.knots
    return np.where(knots == 1, ends[1], ends[0] + knots * (ends[1] - ends[0]))


def _meets_smoothly(surface: Surface, rectangle: Floats, axis: int) -> bool:
    """Whether the derivative across a closed side is the same at both ends."""
    at = rectangle[0] + _SIDE[:, None] * (rectangle[1] - rectangle[0])
    sides = []
    for end in (0, 1):
        places = at.copy()
        places[:, axis] = rectangle[end, axis]
        sides.append(surface.derivatives(places[:, 0], places[:, 1])[1 + axis])
    scale = np.abs(sides[0]).max()
    return bool(np.abs(sides[1] - sides[0]).max() <= _SMOOTH * scale)


def _merge(*found: KnotPlanes) -> KnotPlanes:
    """All breaks in order, the least smooth of those that are one knot."""
    values = np.concatenate([each.values for each in found])
    continuity = np.concatenate([each.continuity for each in found])
    order = np.argsort(values)
    values, continuity = values[order], continuity[order]
    if not len(values):
        return KnotPlanes(values, continuity)
    first = np.flatnonzero(np.diff(values, prepend=-np.inf) > _ONE_KNOT)
    return KnotPlanes(values[first], np.minimum.reduceat(continuity, first))


def _end_free(known: KnotPlanes, degree: int) -> bool:
    """Whether no break lies at an end of the axis."""
    at_end = (known.values <= _ONE_KNOT) | (known.values >= 1 - _ONE_KNOT)
    return not bool((at_end & (known.continuity < degree - 1)).any())


def _axis(known: KnotPlanes, closed: Closed, degree: int) -> Axis:
    """The first knots: where the image is not smooth, and enough of them for a closed axis."""
    inside = (known.values > _ONE_KNOT) & (known.values < 1 - _ONE_KNOT)
    counted = inside & (known.continuity < degree)
    values, continuity = known.values[counted], known.continuity[counted]
    mults = np.clip(degree - continuity, 1, degree)
    axis = Axis(degree, (0.0, *values.tolist(), 1.0), tuple(mults.tolist()), closed)
    if not closed:
        return axis
    lengths = np.diff(axis.breaks)
    return axis.split(np.ceil(lengths * _ROUND - _ONE_KNOT).astype(np.int64))
