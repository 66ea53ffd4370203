"""Surfaces of faces, parametrised as OpenCascade does.

One record for each kind. Parameters ``u`` and ``v`` broadcast together; an open grid, ``u`` (n, 1)
and ``v`` (1, m), costs B-splines the least. Axis systems may be left-handed.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from ffdcli.arrays import Floats
from ffdcli.part.curves import NO_BREAKS, Curve, homogeneous, knots_between, turns, wrap
from ffdcli.splines.knots import KnotPlanes

# Orders of the derivatives along u and v, in the order in which they are returned.
_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


class Surface(Protocol):
    """A surface in space."""

    @property
    def kind(self) -> str:
        """Name of the kind, for reports."""
        ...

    @property
    def periods(self) -> tuple[float | None, float | None]:
        """Periods of u and v; None for none."""
        ...

    def points(self, u: Floats, v: Floats) -> Floats:
        """Points (..., 3) at parameters that broadcast to (...)."""
        ...

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        ...

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        ...


@dataclass(frozen=True, eq=False)
class _Surface:
    """What surfaces share."""

    def points(self, u: Floats, v: Floats) -> Floats:
        """Points (..., 3) at parameters that broadcast to (...)."""
        return self.derivatives(u, v, 0)[0]

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        raise NotImplementedError

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """No values: the surface is smooth."""
        return NO_BREAKS


@dataclass(frozen=True, eq=False)
class _Placed(_Surface):
    """A surface in an axis system.

    Parameters
    ----------
    origin, x, y, z : (3,) float64
        The axes are unit and perpendicular; ``z`` may be ``-x cross y``.
    """

    origin: Floats
    x: Floats
    y: Floats
    z: Floats


@dataclass(frozen=True, eq=False)
class Plane(_Placed):
    """``origin + u x + v y``."""

    kind = "plane"
    periods = (None, None)

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        u, v = _parameters(u, v)
        points = self.origin + u[..., None] * self.x + v[..., None] * self.y
        known = (points, self.x, self.y, np.zeros(3), np.zeros(3), np.zeros(3))
        return tuple(np.broadcast_to(each, points.shape) for each in known[: _count(order)])


@dataclass(frozen=True, eq=False)
class _Round(_Placed):
    """``origin + rho(v) (cos(u) x + sin(u) y) + h(v) z``."""

    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""
        raise NotImplementedError

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        u, v = _parameters(u, v)
        cosines, sines = turns(u, order)
        rays = cosines[..., None] * self.x + sines[..., None] * self.y
        radii, heights = (each[..., None] for each in self.profile(v, order))
        out = []
        for i, j in _ORDERS[: _count(order)]:
            value = radii[j] * rays[i]
            if i == 0:
                value = value + heights[j] * self.z
            out.append(value)
        out[0] = out[0] + self.origin
        return tuple(out)


@dataclass(frozen=True, eq=False)
class Cylinder(_Round):
    """``origin + radius (cos(u) x + sin(u) y) + v z``."""

    radius: float
    kind = "cylinder"
    periods = (2 * np.pi, None)

    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""
        radii, heights = np.zeros((2, order + 1, *v.shape))
        radii[0] = self.radius
        heights[0] = v
        heights[1:2] = 1.0
        return radii, heights


@dataclass(frozen=True, eq=False)
class Cone(_Round):
    """``origin + (radius + v sin(angle)) (cos(u) x + sin(u) y) + v cos(angle) z``."""

    radius: float
    angle: float
    kind = "cone"
    periods = (2 * np.pi, None)

    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""
        radii, heights = np.zeros((2, order + 1, *v.shape))
        radii[0] = self.radius + v * np.sin(self.angle)
        radii[1:2] = np.sin(self.angle)
        heights[0] = v * np.cos(self.angle)
        heights[1:2] = np.cos(self.angle)
        return radii, heights


@dataclass(frozen=True, eq=False)
class Torus(_Round):
    """``origin + (major + minor cos(v)) (cos(u) x + sin(u) y) + minor sin(v) z``."""

    major: float
    minor: float
    kind = "torus"
    periods = (2 * np.pi, 2 * np.pi)

    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""
        cosines, sines = turns(v, order)
        radii = self.minor * cosines
        radii[0] += self.major
        return radii, self.minor * sines


@dataclass(frozen=True, eq=False)
class Sphere(_Round):
    """``origin + radius cos(v) (cos(u) x + sin(u) y) + radius sin(v) z``."""

    radius: float
    kind = "sphere"
    periods = (2 * np.pi, None)

    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""
        cosines, sines = turns(v, order)
        return self.radius * cosines, self.radius * sines


@dataclass(frozen=True, eq=False)
class BSplineSurface(_Surface):
    """A tensor-product B-spline, rational where it has weights.

    Parameters
    ----------
    degrees : (int, int)
    knots : two (n + degree + 1,) float64
        Repeated by multiplicity; the end ones ``degree + 1`` times.
    poles : (nu, nv, 3) float64
    weights : (nu, nv) float64 or None
    periods : two of float or None
        Lengths of the domain along u and v, where the surface goes on beyond as at the other end.
    closing : (int, int)
        Continuity where a periodic direction closes.
    """

    degrees: tuple[int, int]
    knots: tuple[Floats, Floats]
    poles: Floats
    weights: Floats | None = None
    periods: tuple[float | None, float | None] = (None, None)
    closing: tuple[int, int] = (0, 0)
    kind = "b-spline"

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        at = [
            wrap(each, self.knots[axis], self.degrees[axis], self.periods[axis])
            for axis, each in enumerate((u, v))
        ]
        net = homogeneous(self.poles, self.weights)
        orders = _ORDERS[: _count(order)]
        if at[0].ndim == 2 and at[0].shape[1] == 1 and at[1].ndim == 2 and at[1].shape[0] == 1:
            known = self._on_grid(net, at[0][:, 0], at[1][0], orders)
        else:
            places = np.stack(np.broadcast_arrays(*at), axis=-1)
            spline = NdBSpline(self.knots, np.ascontiguousarray(net), self.degrees)
            known = [spline(places, nu=each) for each in orders]
        return tuple(known if self.weights is None else _divided(known))

    def _on_grid(
        self, net: Floats, u: Floats, v: Floats, orders: tuple[tuple[int, int], ...]
    ) -> list[Floats]:
        """Derivatives on an open grid, one direction after the other."""
        along = BSpline(self.knots[0], net, self.degrees[0])
        rows = [along(u, n) for n in range(orders[-1][1] + 1)]
        splines = [BSpline(self.knots[1], row, self.degrees[1], axis=1) for row in rows]
        return [splines[i](v, j) for i, j in orders]

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        knots, degree = self.knots[axis], self.degrees[axis]
        return knots_between(knots, degree, self.periods[axis], self.closing[axis], low, high)


@dataclass(frozen=True, eq=False)
class Extrusion(_Surface):
    """``basis(u) + v direction``.

    Parameters
    ----------
    basis : Curve
    direction : (3,) float64
    """

    basis: Curve
    direction: Floats
    kind = "extrusion"

    @property
    def periods(self) -> tuple[float | None, float | None]:
        """Periods of u and v; None for none."""
        return self.basis.period, None

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        u, v = _parameters(u, v)
        curve = self.basis.derivatives(u, order)
        points = curve[0] + v[..., None] * self.direction
        known = [points, *curve[1:2], self.direction, *curve[2:3], np.zeros(3), np.zeros(3)]
        return tuple(np.broadcast_to(each, points.shape) for each in known[: _count(order)])

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        return NO_BREAKS if axis else self.basis.breaks(low, high)


@dataclass(frozen=True, eq=False)
class Revolution(_Surface):
    """``basis(v)`` turned about an axis by the angle ``u``.

    Parameters
    ----------
    basis : Curve
    origin, axis : (3,) float64
        The axis is unit.
    """

    basis: Curve
    origin: Floats
    axis: Floats
    kind = "revolution"

    @property
    def periods(self) -> tuple[float | None, float | None]:
        """Periods of u and v; None for none."""
        return 2 * np.pi, self.basis.period

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        u, v = _parameters(u, v)
        curve = self.basis.derivatives(v, order)
        curve[0] -= self.origin
        height = (curve @ self.axis)[..., None] * self.axis
        ray = curve - height
        across = np.cross(self.axis, curve)
        cosines, sines = (each[..., None] for each in turns(u, order))
        out = []
        for i, j in _ORDERS[: _count(order)]:
            value = cosines[i] * ray[j] + sines[i] * across[j]
            out.append(value + height[j] if i == 0 else value)
        out[0] = out[0] + self.origin
        return tuple(out)

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        return self.basis.breaks(low, high) if axis else NO_BREAKS


@dataclass(frozen=True, eq=False)
class Offset(_Surface):
    """A surface at a distance from a basis, along the normal ``du cross dv``.

    Parameters
    ----------
    basis : Surface
    distance : float
    middle : (float, float)
        Parameters in the middle of the face. At a pole or an apex the normal is the limit from
        there.
    """

    basis: Surface
    distance: float
    middle: tuple[float, float] = (0.0, 0.0)
    kind = "offset"

    @property
    def periods(self) -> tuple[float | None, float | None]:
        """Periods of u and v; None for none."""
        return self.basis.periods

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du and dv, each (..., 3); order at most 1."""
        if order > 1:
            raise ValueError("offset surfaces have derivatives of order 1 at most")
        known = self.basis.derivatives(u, v, 2)
        points, du, dv, duu, duv, dvv = known
        normal = np.cross(du, dv)
        turn_u = np.cross(duu, dv) + np.cross(du, duv)
        turn_v = np.cross(duv, dv) + np.cross(du, dvv)
        flat = _is_flat(normal, du, dv)
        if flat.any():
            side_u, side_v = (
                np.where(np.asarray(each) < inside, 1.0, -1.0)[..., None]
                for each, inside in zip((u, v), self.middle, strict=True)
            )
            along_v = np.abs(turn_v).max(axis=-1, keepdims=True) > 0
            normal = np.where(flat, np.where(along_v, side_v * turn_v, side_u * turn_u), normal)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        unit = normal / length
        out = [points + self.distance * unit]
        if order:
            for slope, turn in ((du, turn_u), (dv, turn_v)):
                bent = (turn - unit * (unit * turn).sum(axis=-1, keepdims=True)) / length
                out.append(slope + self.distance * np.where(flat, 0.0, bent))
        return tuple(out)

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Breaks of the basis, less smooth by one."""
        found = self.basis.breaks(axis, low, high)
        return KnotPlanes(found.values, np.maximum(found.continuity - 1, 0))


def _is_flat(normal: Floats, du: Floats, dv: Floats) -> Floats:
    """(..., 1) True where the tangents span no plane, to rounding."""
    lengths = [np.linalg.norm(each, axis=-1, keepdims=True) for each in (normal, du, dv)]
    largest = max(float(each.max(initial=0.0)) for each in lengths[1:])
    return np.asarray(lengths[0] <= 1e-12 * largest * np.maximum(lengths[1], lengths[2]))


def _count(order: int) -> int:
    """Number of derivatives up to an order, the point included."""
    return (order + 1) * (order + 2) // 2


def _parameters(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Parameters as arrays of equal rank, so that they broadcast with a trailing coordinate."""
    u, v = np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)
    rank = max(u.ndim, v.ndim)
    return (
        u.reshape((1,) * (rank - u.ndim) + u.shape),
        v.reshape((1,) * (rank - v.ndim) + v.shape),
    )


def _divided(known: list[Floats]) -> list[Floats]:
    """Derivatives of a surface from those of its homogeneous form, in the same order.

    Piegl and Tiller, The NURBS Book, Eq. 4.20.
    """
    weights = {orders: each[..., -1:] for orders, each in zip(_ORDERS, known, strict=False)}
    out: dict[tuple[int, int], Floats] = {}
    for (k, m), each in zip(_ORDERS, known, strict=False):
        above = each[..., :-1].copy()
        for i in range(k + 1):
            for j in range(m + 1):
                if i or j:
                    above -= comb(k, i) * comb(m, j) * weights[i, j] * out[k - i, m - j]
        out[k, m] = above / weights[0, 0]
    return list(out.values())
