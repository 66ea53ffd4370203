"""Surfaces of faces, parametrised as OpenCascade does.

One record for each kind. Parameters ``u`` and ``v`` broadcast together; an open grid, ``u`` (n, 1)
and ``v`` (1, m), costs B-splines the least.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from ffdcli.arrays import Floats
from ffdcli.part.curves import NO_BREAKS, Curve, homogeneous, knots_between, turns, wrap
from ffdcli.part.elementary_surfaces import (
    ORDERS,
    Cone,
    Cylinder,
    Plane,
    Sphere,
    Surface,
    SurfaceBase,
    Torus,
    count_of,
    parameters,
)
from ffdcli.splines.knots import KnotPlanes

__all__ = [
    "BSplineSurface",
    "Cone",
    "Cylinder",
    "Extrusion",
    "Offset",
    "Plane",
    "Revolution",
    "Sphere",
    "Surface",
    "Torus",
]


@dataclass(frozen=True, eq=False)
class BSplineSurface(SurfaceBase):
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
        orders = ORDERS[: count_of(order)]
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
class Extrusion(SurfaceBase):
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
        u, v = parameters(u, v)
        curve = self.basis.derivatives(u, order)
        points = curve[0] + v[..., None] * self.direction
        known = [points, *curve[1:2], self.direction, *curve[2:3], np.zeros(3), np.zeros(3)]
        return tuple(np.broadcast_to(each, points.shape) for each in known[: count_of(order)])

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        return NO_BREAKS if axis else self.basis.breaks(low, high)


@dataclass(frozen=True, eq=False)
class Revolution(SurfaceBase):
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
        u, v = parameters(u, v)
        curve = self.basis.derivatives(v, order)
        curve[0] -= self.origin
        height = (curve @ self.axis)[..., None] * self.axis
        ray = curve - height
        across = np.cross(self.axis, curve)
        cosines, sines = (each[..., None] for each in turns(u, order))
        out = []
        for i, j in ORDERS[: count_of(order)]:
            value = cosines[i] * ray[j] + sines[i] * across[j]
            out.append(value + height[j] if i == 0 else value)
        out[0] = out[0] + self.origin
        return tuple(out)

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """Values of u (axis 0) or v strictly between two where it is C^continuity only."""
        return self.basis.breaks(low, high) if axis else NO_BREAKS


@dataclass(frozen=True, eq=False)
class Offset(SurfaceBase):
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


def _divided(known: list[Floats]) -> list[Floats]:
    """Derivatives of a surface from those of its homogeneous form, in the same order.

    Piegl and Tiller, The NURBS Book, Eq. 4.20.
    """
    weights = {orders: each[..., -1:] for orders, each in zip(ORDERS, known, strict=False)}
    out: dict[tuple[int, int], Floats] = {}
    for (k, m), each in zip(ORDERS, known, strict=False):
        above = each[..., :-1].copy()
        for i in range(k + 1):
            for j in range(m + 1):
                if i or j:
                    above -= comb(k, i) * comb(m, j) * weights[i, j] * out[k - i, m - j]
        out[k, m] = above / weights[0, 0]
    return list(out.values())
