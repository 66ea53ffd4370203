"""Records of :mod:`ffdcli.part` as OpenCascade's curves and surfaces, with the same parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import KernelError
from ffdcli.part import curves, surfaces
from ffdcli.part.curves import Curve
from ffdcli.part.surfaces import Surface


def build_curve(curve: Curve) -> Any:
    """A curve in space.

    Raises
    ------
    KernelError
        OpenCascade has no such curve.
    """
    from OCP import Geom
    from OCP.gp import gp_Ax2

    if isinstance(curve, curves.BSplineCurve):
        return _spline_curve(curve)
    if isinstance(curve, curves.Line):
        # Its direction is unit.
        return Geom.Geom_Line(_point(curve.origin), _direction(curve.direction))
    if isinstance(curve, curves.OffsetCurve) and curve.reference is not None:
        basis, reference = build_curve(curve.basis), _direction(curve.reference)
        return Geom.Geom_OffsetCurve(basis, curve.distance, reference)
    if isinstance(curve, curves.Ellipse | curves.Hyperbola | curves.Parabola):
        normal = np.cross(curve.x, curve.y)
        place = gp_Ax2(_point(curve.origin), _direction(normal), _direction(curve.x))
        if isinstance(curve, curves.Parabola):
            return Geom.Geom_Parabola(place, curve.focal)
        if isinstance(curve, curves.Circle):
            return Geom.Geom_Circle(place, curve.major)
        make = Geom.Geom_Ellipse if isinstance(curve, curves.Ellipse) else Geom.Geom_Hyperbola
        return make(place, curve.major, curve.minor)
    raise KernelError(f"OpenCascade has no curve of kind {curve.kind}")


def build_surface(surface: Surface) -> Any:
    """A surface.

    Raises
    ------
    KernelError
        OpenCascade has no such surface.
    """
    from OCP import Geom
    from OCP.gp import gp_Ax1

    if isinstance(surface, surfaces.BSplineSurface):
        return _spline_surface(surface)
    if isinstance(surface, surfaces.Plane):
        return Geom.Geom_Plane(_axes(surface))
    if isinstance(surface, surfaces.Cylinder):
        return Geom.Geom_CylindricalSurface(_axes(surface), surface.radius)
    if isinstance(surface, surfaces.Cone):
        return Geom.Geom_ConicalSurface(_axes(surface), surface.angle, surface.radius)
    if isinstance(surface, surfaces.Sphere):
        return Geom.Geom_SphericalSurface(_axes(surface), surface.radius)
    if isinstance(surface, surfaces.Torus):
        return Geom.Geom_ToroidalSurface(_axes(surface), surface.major, surface.minor)
    if isinstance(surface, surfaces.Extrusion):
        return Geom.Geom_SurfaceOfLinearExtrusion(
            build_curve(surface.basis), _direction(surface.direction)
        )
    if isinstance(surface, surfaces.Revolution):
        axis = gp_Ax1(_point(surface.origin), _direction(surface.axis))
        return Geom.Geom_SurfaceOfRevolution(build_curve(surface.basis), axis)
    if isinstance(surface, surfaces.Offset):
        return Geom.Geom_OffsetSurface(build_surface(surface.basis), surface.distance)
    raise KernelError(f"OpenCascade has no surface of kind {surface.kind}")


def _axes(surface: Any) -> Any:
    """The axis system of a surface, which may be left-handed."""
    from OCP.gp import gp_Ax3

    place = gp_Ax3(_point(surface.origin), _direction(surface.z), _direction(surface.x))
    if np.cross(surface.x, surface.y) @ surface.z < 0:
        place.YReverse()
    return place


def _spline_curve(curve: curves.BSplineCurve) -> Any:
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt

    poles = TColgp_Array1OfPnt(1, len(curve.poles))
    for number, pole in enumerate(curve.poles.tolist(), start=1):
        poles.SetValue(number, gp_Pnt(*pole))
    about = (*breaks_of(curve.knots), curve.degree)
    if curve.weights is None:
        made = Geom_BSplineCurve(poles, *about)
    else:
        made = Geom_BSplineCurve(poles, _reals(curve.weights), *about)
    if curve.period is not None:
        made.SetPeriodic()
    return made


def _spline_surface(surface: surfaces.BSplineSurface) -> Any:
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array2OfReal

    count_u, count_v = surface.poles.shape[:2]
    poles = TColgp_Array2OfPnt(1, count_u, 1, count_v)
    for i, row in enumerate(surface.poles.tolist(), start=1):
        for j, pole in enumerate(row, start=1):
            poles.SetValue(i, j, gp_Pnt(*pole))
    (knots_u, mults_u), (knots_v, mults_v) = map(breaks_of, surface.knots)
    about = (knots_u, knots_v, mults_u, mults_v, *surface.degrees)
    if surface.weights is None:
        made = Geom_BSplineSurface(poles, *about)
    else:
        weights = TColStd_Array2OfReal(1, count_u, 1, count_v)
        for i, line in enumerate(surface.weights.tolist(), start=1):
            for j, value in enumerate(line, start=1):
                weights.SetValue(i, j, value)
        made = Geom_BSplineSurface(poles, weights, *about)
    if surface.periods[0] is not None:
        made.SetUPeriodic()
    if surface.periods[1] is not None:
        made.SetVPeriodic()
    return made


def _point(values: Floats) -> Any:
    from OCP.gp import gp_Pnt

    return gp_Pnt(*values.tolist())


def _direction(values: Floats) -> Any:
    from OCP.gp import gp_Dir

    return gp_Dir(*values.tolist())


def breaks_of(knots: Floats) -> tuple[Any, Any]:
    """Distinct knots and their multiplicities, as OpenCascade's arrays."""
    from OCP.TColStd import TColStd_Array1OfInteger

    values, counts = np.unique(knots, return_counts=True)
    mults = TColStd_Array1OfInteger(1, len(counts))
    for number, count in enumerate(counts.tolist(), start=1):
        mults.SetValue(number, count)
    return _reals(values), mults


def _reals(values: Floats) -> Any:
    from OCP.TColStd import TColStd_Array1OfReal

    out = TColStd_Array1OfReal(1, len(values))
    for number, value in enumerate(np.asarray(values).tolist(), start=1):
        out.SetValue(number, value)
    return out
