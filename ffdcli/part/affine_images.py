"""Exact images of surfaces and curves under affine maps, where the parameters stay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part import curves, surfaces
from ffdcli.part.curves import Curve
from ffdcli.part.surfaces import Surface

# A map whose lengths differ from those of a similarity by no more than this is one.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class AffineMap:
    """``D(x) = matrix @ x + offset``.

    Parameters
    ----------
    matrix : (3, 3) float64
    offset : (3,) float64
    """

    matrix: Floats
    offset: Floats

    def points(self, points: Floats) -> Floats:
        """Images (..., 3) of points (..., 3)."""
        return points @ self.matrix.T + self.offset

    def vectors(self, vectors: Floats) -> Floats:
        """Images (..., 3) of vectors (..., 3)."""
        return vectors @ self.matrix.T

    @property
    def scale(self) -> float | None:
        """The factor of all lengths; None where the map is no similarity."""
        square = self.matrix.T @ self.matrix
        factor = float(np.trace(square)) / 3
        if np.abs(square - factor * np.eye(3)).max() > _ROUNDING * factor:
            return None
        return float(np.sqrt(factor))

    @property
    def keeps_lengths(self) -> bool:
        """Whether the map is a motion."""
        scale = self.scale
        return scale is not None and abs(scale - 1) <= _ROUNDING


def affine_curve(curve: Curve, by: AffineMap) -> Curve | None:
    """The image of a curve with the same parameters; None where it is of no exact kind."""
    if isinstance(curve, curves.BSplineCurve):
        return replace(curve, poles=by.points(curve.poles))
    if isinstance(curve, curves.OffsetCurve):
        basis = affine_curve(curve.basis, by)
        if basis is None or by.scale is None or curve.reference is None:
            return None
        # A mirror image turns the side on which the offset lies.
        side = np.sign(np.linalg.det(by.matrix))
        reference = by.vectors(curve.reference) / by.scale
        return replace(
            curve, basis=basis, distance=side * by.scale * curve.distance, reference=reference
        )
    scale = by.scale
    if scale is None:
        return None
    if isinstance(curve, curves.Ellipse):
        return replace(
            curve,
            origin=by.points(curve.origin),
            x=by.vectors(curve.x) / scale,
            y=by.vectors(curve.y) / scale,
            major=scale * curve.major,
            minor=scale * curve.minor,
        )
    if not by.keeps_lengths:
        return None
    if isinstance(curve, curves.Line):
        return replace(curve, origin=by.points(curve.origin), direction=by.vectors(curve.direction))
    if isinstance(curve, (curves.Hyperbola, curves.Parabola)):
        origin, x, y = by.points(curve.origin), by.vectors(curve.x), by.vectors(curve.y)
        return replace(curve, origin=origin, x=x, y=y)
    return None


def line_as_spline(line: curves.Line, low: float, high: float) -> curves.BSplineCurve:
    """A line over a range of its parameter as a B-spline of degree 1, with the same parameter."""
    return curves.BSplineCurve(
        1, np.array([low, low, high, high]), line.points(np.array([low, high]))
    )


def affine_surface(surface: Surface, rectangle: Floats, by: AffineMap) -> Surface | None:
    """The image of a surface with the same parameters; None where it is of no exact kind.

    Planes stay planes, with other parameters: nothing on them is given by parameters.

    Parameters
    ----------
    surface : Surface
    rectangle : (2, 2) float64
        Parameters that the face reaches.
    by : AffineMap
    """
    if isinstance(surface, surfaces.BSplineSurface):
        return replace(surface, poles=by.points(surface.poles))
    if isinstance(surface, surfaces.Plane):
        return _plane(surface, by)
    if isinstance(surface, surfaces.Extrusion) and isinstance(surface.basis, curves.BSplineCurve):
        return _extruded(surface, rectangle[:, 1], by)
    scale = by.scale
    if scale is None:
        return None
    if isinstance(surface, surfaces.Offset):
        basis = affine_surface(surface.basis, rectangle, by)
        side = np.sign(np.linalg.det(by.matrix))
        if basis is None or isinstance(surface.basis, surfaces.Plane):
            return None
        return replace(surface, basis=basis, distance=side * scale * surface.distance)
    if isinstance(surface, surfaces.Revolution):
        turned = affine_curve(surface.basis, by)
        if turned is None:
            return None
        side = np.sign(np.linalg.det(by.matrix))
        axis = side * by.vectors(surface.axis) / scale
        return replace(surface, basis=turned, origin=by.points(surface.origin), axis=axis)
    if isinstance(surface, surfaces.Sphere):
        return replace(_placed(surface, by, scale), radius=scale * surface.radius)
    if isinstance(surface, surfaces.Torus):
        major, minor = scale * surface.major, scale * surface.minor
        return replace(_placed(surface, by, scale), major=major, minor=minor)
    if by.keeps_lengths and isinstance(surface, surfaces.Cylinder):
        return _placed(surface, by, scale)
    if by.keeps_lengths and isinstance(surface, surfaces.Cone):
        return _placed(surface, by, scale)
    return None


_Kind = TypeVar("_Kind", surfaces.Cylinder, surfaces.Cone, surfaces.Sphere, surfaces.Torus)


def _placed(surface: _Kind, by: AffineMap, scale: float) -> _Kind:
    """A surface in its axis system after a similarity."""
    x, y, z = (by.vectors(each) / scale for each in (surface.x, surface.y, surface.z))
    return replace(surface, origin=by.points(surface.origin), x=x, y=y, z=z)


def _plane(plane: surfaces.Plane, by: AffineMap) -> surfaces.Plane:
    """The image of a plane, with the normal on the same side of the face."""
    along, across = by.vectors(plane.x), by.vectors(plane.y)
    x = along / np.linalg.norm(along)
    y = across - x * (x @ across)
    y /= np.linalg.norm(y)
    side = np.sign(np.cross(plane.x, plane.y) @ plane.z)
    return surfaces.Plane(by.points(plane.origin), x, y, side * np.cross(x, y))


def plane_before(old: surfaces.Plane, new: surfaces.Plane, by: AffineMap) -> surfaces.Plane:
    """A plane with the parameters of its image; its axes are neither unit nor perpendicular."""
    x, y = np.linalg.solve(by.matrix, np.stack([new.x, new.y], axis=1)).T
    return replace(old, x=x, y=y)


def _extruded(surface: surfaces.Extrusion, ends: Floats, by: AffineMap) -> surfaces.BSplineSurface:
    """The image of a translated B-spline over a range of v, as a B-spline."""
    basis = surface.basis
    assert isinstance(basis, curves.BSplineCurve)
    poles = basis.poles[:, None] + ends[:, None] * surface.direction
    weights = None if basis.weights is None else np.repeat(basis.weights[:, None], 2, axis=1)
    return surfaces.BSplineSurface(
        (basis.degree, 1),
        (basis.knots, np.repeat(ends, 2)),
        by.points(poles),
        weights,
        (basis.period, None),
        (basis.closing, 0),
    )
