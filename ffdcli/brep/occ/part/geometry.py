"""OpenCascade's curves and surfaces as records of :mod:`ffdcli.part`, with the same parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import KernelError
from ffdcli.part import curves, surfaces
from ffdcli.part.curves import Curve
from ffdcli.part.surfaces import Surface


def read_curve(curve: Any, what: str) -> Curve:
    """The record of a curve in space, or in the parameters of a surface.

    Parameters
    ----------
    curve : Geom_Curve or Geom2d_Curve
    what : str
        Names the curve in messages, such as ``edge 3``.

    Raises
    ------
    KernelError
        The curve is of no known kind.
    """
    kind = _kind_of(curve)
    if kind == "TrimmedCurve":
        return read_curve(curve.BasisCurve(), what)
    if kind == "OffsetCurve":
        basis = read_curve(curve.BasisCurve(), what)
        flat = type(curve).__name__.startswith("Geom2d")
        return curves.OffsetCurve(
            basis, curve.Offset(), None if flat else _array(curve.Direction())
        )
    if kind == "Line":
        return curves.Line(
            _array(curve.Position().Location()), _array(curve.Position().Direction())
        )
    if kind in ("BSplineCurve", "BezierCurve"):
        return _spline_curve(curve, kind)
    if kind not in ("Circle", "Ellipse", "Hyperbola", "Parabola"):
        raise KernelError(f"{what} lies on a curve of a kind that is not known: {kind}")
    place = curve.Position()
    origin, x, y = (
        _array(each) for each in (place.Location(), place.XDirection(), place.YDirection())
    )
    if kind == "Circle":
        return curves.Circle(origin, x, y, curve.Radius(), curve.Radius())
    if kind == "Parabola":
        return curves.Parabola(origin, x, y, curve.Focal())
    make = curves.Ellipse if kind == "Ellipse" else curves.Hyperbola
    return make(origin, x, y, curve.MajorRadius(), curve.MinorRadius())


def read_surface(surface: Any, what: str) -> Surface:
    """The record of a surface.

    Parameters
    ----------
    surface : Geom_Surface
    what : str
        Names the surface in messages, such as ``face 3``.

    Raises
    ------
    KernelError
        The surface is of no known kind.
    """
    kind = _kind_of(surface)
    if kind == "RectangularTrimmedSurface":
        return read_surface(surface.BasisSurface(), what)
    if kind == "BezierSurface":
        from OCP.GeomConvert import GeomConvert

        surface, kind = GeomConvert.SurfaceToBSplineSurface_s(surface), "BSplineSurface"
    if kind == "BSplineSurface":
        return _spline_surface(surface)
    if kind == "SurfaceOfLinearExtrusion":
        return surfaces.Extrusion(
            read_curve(surface.BasisCurve(), what), _array(surface.Direction())
        )
    if kind == "SurfaceOfRevolution":
        axis = surface.Axis()
        return surfaces.Revolution(
            read_curve(surface.BasisCurve(), what),
            _array(axis.Location()),
            _array(axis.Direction()),
        )
    if kind == "OffsetSurface":
        return surfaces.Offset(read_surface(surface.BasisSurface(), what), surface.Offset())
    if kind not in _PLACED:
        raise KernelError(f"{what} lies on a surface of a kind that is not known: {kind}")
    make, lengths = _PLACED[kind]
    place = surface.Position()
    axes = (place.Location(), place.XDirection(), place.YDirection(), place.Direction())
    return make(*map(_array, axes), *(getattr(surface, length)() for length in lengths))


_PLACED: dict[str, tuple[Any, tuple[str, ...]]] = {
    "Plane": (surfaces.Plane, ()),
    "CylindricalSurface": (surfaces.Cylinder, ("Radius",)),
    "ConicalSurface": (surfaces.Cone, ("RefRadius", "SemiAngle")),
    "SphericalSurface": (surfaces.Sphere, ("Radius",)),
    "ToroidalSurface": (surfaces.Torus, ("MajorRadius", "MinorRadius")),
}


def _kind_of(geometry: Any) -> str:
    return type(geometry).__name__.split("_", 1)[-1]


def _array(value: Any) -> Floats:
    return np.array(value.Coord())


def _spline_curve(curve: Any, kind: str) -> Curve:
    """A B-spline or Bézier curve, clamped."""
    degree = curve.Degree()
    if kind == "BezierCurve":
        knots = np.repeat([0.0, 1.0], degree + 1)
        period, closing = None, 0
    else:
        period, closing = None, 0
        if curve.IsPeriodic():
            period = curve.LastParameter() - curve.FirstParameter()
            closing = degree - curve.Multiplicity(1)
            curve = curve.Copy()
            curve.SetNotPeriodic()
        ends = curve.Multiplicity(1), curve.Multiplicity(curve.NbKnots())
        if min(ends) <= degree:
            curve = curve.Copy()
            curve.Segment(curve.FirstParameter(), curve.LastParameter())
        count = range(1, curve.NbKnots() + 1)
        knots = np.repeat(list(map(curve.Knot, count)), list(map(curve.Multiplicity, count)))
    numbers = range(1, curve.NbPoles() + 1)
    poles = np.array([curve.Pole(i).Coord() for i in numbers])
    weights = np.array(list(map(curve.Weight, numbers))) if curve.IsRational() else None
    return curves.BSplineCurve(degree, knots, poles, weights, period, closing)


def _spline_surface(surface: Any) -> Surface:
    """A B-spline surface, clamped."""
    degrees = surface.UDegree(), surface.VDegree()
    low_u, high_u, low_v, high_v = surface.Bounds()
    lengths = high_u - low_u, high_v - low_v
    turning = surface.IsUPeriodic(), surface.IsVPeriodic()
    closing = degrees[0] - surface.UMultiplicity(1), degrees[1] - surface.VMultiplicity(1)
    if any(turning):
        surface = surface.Copy()
        surface.SetUNotPeriodic()
        surface.SetVNotPeriodic()
    ends = [(surface.UMultiplicity(i), degrees[0]) for i in (1, surface.NbUKnots())]
    ends += [(surface.VMultiplicity(i), degrees[1]) for i in (1, surface.NbVKnots())]
    if any(multiplicity <= degree for multiplicity, degree in ends):
        surface = surface.Copy()
        surface.Segment(*surface.Bounds())
    nu, nv = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    weights = None
    if surface.IsURational() or surface.IsVRational():
        weights = np.array([[surface.Weight(i, j) for j in nv] for i in nu])
    breaks_u, breaks_v = range(1, surface.NbUKnots() + 1), range(1, surface.NbVKnots() + 1)
    return surfaces.BSplineSurface(
        degrees,
        (
            np.repeat(
                list(map(surface.UKnot, breaks_u)), list(map(surface.UMultiplicity, breaks_u))
            ),
            np.repeat(
                list(map(surface.VKnot, breaks_v)), list(map(surface.VMultiplicity, breaks_v))
            ),
        ),
        np.array([[surface.Pole(i, j).Coord() for j in nv] for i in nu]),
        weights,
        (lengths[0] if turning[0] else None, lengths[1] if turning[1] else None),
        (closing[0] if turning[0] else 0, closing[1] if turning[1] else 0),
    )
