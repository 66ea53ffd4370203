"""Planes and surfaces of revolution with straight or round profiles, as OpenCascade has them.

Parameters ``u`` and ``v`` broadcast together. Axis systems may be left-handed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.curves import NO_BREAKS, turns
from ffdcli.splines.knots import KnotPlanes

# Orders of the derivatives along u and v, in the order in which they are returned.
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


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
class SurfaceBase(ABC):
    """What surfaces share."""

    def points(self, u: Floats, v: Floats) -> Floats:
        """Points (..., 3) at parameters that broadcast to (...)."""
        return self.derivatives(u, v, 0)[0]

    @abstractmethod
    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""

    def breaks(self, axis: int, low: float, high: float) -> KnotPlanes:
        """No values: the surface is smooth."""
        return NO_BREAKS


@dataclass(frozen=True, eq=False)
class _Placed(SurfaceBase):
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
        u, v = parameters(u, v)
        points = self.origin + u[..., None] * self.x + v[..., None] * self.y
        known = (points, self.x, self.y, np.zeros(3), np.zeros(3), np.zeros(3))
        return tuple(np.broadcast_to(each, points.shape) for each in known[: count_of(order)])


@dataclass(frozen=True, eq=False)
class _Round(_Placed):
    """``origin + rho(v) (cos(u) x + sin(u) y) + h(v) z``."""

    @abstractmethod
    def profile(self, v: Floats, order: int) -> tuple[Floats, Floats]:
        """Derivatives (order + 1, ...) of rho and of h."""

    def derivatives(self, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points, du, dv and, of order 2, duu, duv, dvv, each (..., 3)."""
        u, v = parameters(u, v)
        cosines, sines = turns(u, order)
        rays = cosines[..., None] * self.x + sines[..., None] * self.y
        radii, heights = (each[..., None] for each in self.profile(v, order))
        out = []
        for i, j in ORDERS[: count_of(order)]:
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


def count_of(order: int) -> int:
    """Number of derivatives up to an order, the point included."""
    return (order + 1) * (order + 2) // 2


def parameters(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Parameters as arrays of equal rank, so that they broadcast with a trailing coordinate."""
    u, v = np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)
    rank = max(u.ndim, v.ndim)
    return (
        u.reshape((1,) * (rank - u.ndim) + u.shape),
        v.reshape((1,) * (rank - v.ndim) + v.shape),
    )
