"""Curves in space and in surface parameters, parametrised as OpenCascade does.

One record for each kind, in two dimensions (pcurves) or three. All parameters (...) are evaluated
at once; derivatives are along the first axis of the result. Trimmed curves are their basis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import comb
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from ffdcli.arrays import Floats
from ffdcli.splines.knots import KnotPlanes, knot_planes

NO_BREAKS = KnotPlanes(np.zeros(0), np.zeros(0, dtype=np.int64))


class Curve(Protocol):
    """A curve in d dimensions."""

    @property
    def kind(self) -> str:
        """Name of the kind, for reports."""
        ...

    @property
    def period(self) -> float | None:
        """The period of the parameter; None where the curve has none."""
        ...

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        ...

    def points(self, t: Floats) -> Floats:
        """Points (..., d) at parameters (...)."""
        ...

    def breaks(self, low: float, high: float) -> KnotPlanes:
        """Parameters strictly between two where the curve is C^continuity only."""
        ...


@dataclass(frozen=True, eq=False)
class _Smooth(ABC):
    """What curves without knots share."""

    def points(self, t: Floats) -> Floats:
        """Points (..., d) at parameters (...)."""
        out: Floats = self.derivatives(t, 0)[0]
        return out

    @abstractmethod
    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""

    def breaks(self, low: float, high: float) -> KnotPlanes:
        """No parameters: the curve is smooth."""
        return NO_BREAKS


@dataclass(frozen=True, eq=False)
class Line(_Smooth):
    """``origin + t direction``.

    Parameters
    ----------
    origin, direction : (d,) float64
    """

    origin: Floats
    direction: Floats
    kind = "line"
    period = None

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        shares = _powers(np.asarray(t, dtype=np.float64), order)
        out = shares[..., None] * self.direction
        out[0] += self.origin
        return out


@dataclass(frozen=True, eq=False)
class Ellipse(_Smooth):
    """``origin + major cos(t) x + minor sin(t) y``.

    Parameters
    ----------
    origin, x, y : (d,) float64
        Centre and unit axes; in two dimensions ``y`` may lie to the right of ``x``.
    major, minor : float
    """

    origin: Floats
    x: Floats
    y: Floats
    major: float
    minor: float
    kind = "ellipse"
    period = 2 * np.pi

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        cosines, sines = turns(np.asarray(t, dtype=np.float64), order)
        out = cosines[..., None] * (self.major * self.x) + sines[..., None] * (self.minor * self.y)
        out[0] += self.origin
        return out


@dataclass(frozen=True, eq=False)
class Circle(Ellipse):
    """An ellipse whose radii are equal: ``origin + radius (cos(t) x + sin(t) y)``."""

    kind = "circle"


@dataclass(frozen=True, eq=False)
class Hyperbola(_Smooth):
    """``origin + major cosh(t) x + minor sinh(t) y``.

    Parameters
    ----------
    origin, x, y : (d,) float64
    major, minor : float
    """

    origin: Floats
    x: Floats
    y: Floats
    major: float
    minor: float
    kind = "hyperbola"
    period = None

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        t = np.asarray(t, dtype=np.float64)
        both = np.stack([np.cosh(t), np.sinh(t)])
        at = np.arange(order + 1) % 2
        first, second = both[at, ..., None], both[1 - at, ..., None]
        out = first * (self.major * self.x) + second * (self.minor * self.y)
        out[0] += self.origin
        return out


@dataclass(frozen=True, eq=False)
class Parabola(_Smooth):
    """``origin + t^2 / (4 focal) x + t y``.

    Parameters
    ----------
    origin, x, y : (d,) float64
    focal : float
        Focal length; 0 makes the curve its axis ``origin + t x``.
    """

    origin: Floats
    x: Floats
    y: Floats
    focal: float
    kind = "parabola"
    period = None

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        t = np.asarray(t, dtype=np.float64)
        line = _powers(t, order)[..., None]
        if not self.focal:
            out = line * self.x
        else:
            square = np.zeros((order + 1, *t.shape))
            for place, value in enumerate((t * t, 2 * t, np.full_like(t, 2.0))[: order + 1]):
                square[place] = value / (4 * self.focal)
            out = square[..., None] * self.x + line * self.y
        out[0] += self.origin
        return out


@dataclass(frozen=True, eq=False)
class BSplineCurve:
    """A B-spline, rational where it has weights.

    Parameters
    ----------
    degree : int
    knots : (n + degree + 1,) float64
        Repeated by multiplicity; the end ones ``degree + 1`` times.
    poles : (n, d) float64
    weights : (n,) float64 or None
    period : float or None
        Length of the domain, where the curve goes on beyond it as at the other end.
    closing : int
        Continuity where a periodic curve closes.
    """

    degree: int
    knots: Floats
    poles: Floats
    weights: Floats | None = None
    period: float | None = None
    closing: int = 0
    kind = "b-spline"

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d) at parameters (...)."""
        t = wrap(t, self.knots, self.degree, self.period)
        spline = BSpline(self.knots, homogeneous(self.poles, self.weights), self.degree)
        out = np.stack([spline(t, n) for n in range(order + 1)])
        return out if self.weights is None else _divided(out)

    def points(self, t: Floats) -> Floats:
        """Points (..., d) at parameters (...)."""
        out: Floats = self.derivatives(t, 0)[0]
        return out

    def breaks(self, low: float, high: float) -> KnotPlanes:
        """Parameters strictly between two where the curve is C^continuity only."""
        return knots_between(self.knots, self.degree, self.period, self.closing, low, high)


@dataclass(frozen=True, eq=False)
class OffsetCurve:
    """A curve at a distance from a basis, along ``tangent x reference``; in the plane to the right.

    Parameters
    ----------
    basis : Curve
    distance : float
    reference : (3,) float64 or None
        None in two dimensions.
    """

    basis: Curve
    distance: float
    reference: Floats | None = None
    kind = "offset"

    @property
    def period(self) -> float | None:
        """The period of the basis."""
        return self.basis.period

    def derivatives(self, t: Floats, order: int = 1) -> Floats:
        """Points and derivatives (order + 1, ..., d), order at most 2, at parameters (...)."""
        known = self.basis.derivatives(t, order + 1)
        if self.reference is None:
            across = np.stack([known[1:, ..., 1], -known[1:, ..., 0]], axis=-1)
        else:
            across = np.cross(known[1:], self.reference)
        return np.asarray(known[:-1] + self.distance * _directions(across))

    def points(self, t: Floats) -> Floats:
        """Points (..., d) at parameters (...)."""
        out: Floats = self.derivatives(t, 0)[0]
        return out

    def breaks(self, low: float, high: float) -> KnotPlanes:
        """Breaks of the basis, less smooth by one."""
        found = self.basis.breaks(low, high)
        return KnotPlanes(found.values, np.maximum(found.continuity - 1, 0))


def turns(t: Floats, order: int) -> tuple[Floats, Floats]:
    """Derivatives (order + 1, ...) of the cosine and of the sine at angles (...)."""
    cosine, sine = np.cos(t), np.sin(t)
    round_trip = np.stack([cosine, -sine, -cosine, sine])
    at = np.arange(order + 1)
    return round_trip[at % 4], round_trip[(at + 3) % 4]


def homogeneous(poles: Floats, weights: Floats | None) -> Floats:
    """Poles (..., d), or (..., d + 1) with the weights behind the weighted poles."""
    if weights is None:
        return poles
    return np.concatenate([poles * weights[..., None], weights[..., None]], axis=-1)


def wrap(t: Floats, knots: Floats, degree: int, period: float | None) -> Floats:
    """Parameters taken into the domain of a periodic spline; unchanged without a period."""
    t = np.asarray(t, dtype=np.float64)
    if period is None:
        return t
    low, high = knots[degree], knots[-degree - 1]
    return np.where((t < low) | (t > high), low + np.mod(t - low, period), t)


def knots_between(
    knots: Floats, degree: int, period: float | None, closing: int, low: float, high: float
) -> KnotPlanes:
    """Knots strictly between two parameters, and the continuity there."""
    found = knot_planes(knots, degree)
    values, continuity = found.values, found.continuity
    if period is not None:
        values = np.concatenate([[knots[degree]], values])
        continuity = np.concatenate([[np.int64(closing)], continuity])
        first = int(np.floor((low - knots[degree]) / period))
        last = int(np.floor((high - knots[degree]) / period))
        shifts = np.arange(first, last + 1)
        values = (values + shifts[:, None] * period).ravel()
        continuity = np.tile(continuity, len(shifts))
    inside = (values > low) & (values < high)
    return KnotPlanes(values[inside], continuity[inside])


def _powers(t: Floats, order: int) -> Floats:
    """The function ``t`` and its derivatives (order + 1, ...)."""
    out = np.zeros((order + 1, *t.shape))
    out[0] = t
    out[1:2] = 1.0
    return out


def _divided(known: Floats) -> Floats:
    """Derivatives (order + 1, ..., d) of a curve from those of its homogeneous form.

    Piegl and Tiller, The NURBS Book, Eq. 4.8.
    """
    out = np.empty((*known.shape[:-1], known.shape[-1] - 1))
    weights = known[..., -1:]
    for k in range(len(known)):
        above = known[k, ..., :-1].copy()
        for i in range(1, k + 1):
            above -= comb(k, i) * weights[i] * out[k - i]
        out[k] = above / weights[0]
    return out


def _directions(across: Floats) -> Floats:
    """Unit vectors and their derivatives (order + 1, ..., d), order at most 2, from vectors'."""
    length = np.linalg.norm(across[0], axis=-1, keepdims=True)
    unit = across[0] / length
    out = [unit]
    if len(across) > 1:
        growth = (unit * across[1]).sum(axis=-1, keepdims=True)
        turn = (across[1] - unit * growth) / length
        out.append(turn)
    if len(across) > 2:
        more = (turn * across[1] + unit * across[2]).sum(axis=-1, keepdims=True)
        out.append((across[2] - 2 * turn * growth - unit * more) / length)
    return np.stack(out)
