"""Pairs of a record of ffdcli.part and OpenCascade's own object, with random axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_OffsetCurve,
    Geom_OffsetSurface,
    Geom_Parabola,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.Geom2d import (
    Geom2d_BSplineCurve,
    Geom2d_Circle,
    Geom2d_Ellipse,
    Geom2d_Line,
    Geom2d_OffsetCurve,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Ax22d, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import (
    TColStd_Array1OfInteger,
    TColStd_Array1OfReal,
    TColStd_Array2OfReal,
)

from ffdcli.arrays import Floats
from ffdcli.part import curves, surfaces


def axes(rng: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats, Any]:
    """Origin and axes of a random system of either hand, and OpenCascade's."""
    origin, z, x = rng.normal(size=(3, 3))
    system = gp_Ax3(gp_Pnt(*origin), gp_Dir(*z), gp_Dir(*x))
    if rng.random() < 0.5:
        system.YReverse()
    names = ("XDirection", "YDirection", "Direction")
    return origin, *(np.array(getattr(system, name)().Coord()) for name in names), system


def _curve_axes(rng: np.random.Generator) -> tuple[Floats, Floats, Floats, Any]:
    """Origin, x, y and OpenCascade's right-handed system."""
    origin, z, x = rng.normal(size=(3, 3))
    system = gp_Ax2(gp_Pnt(*origin), gp_Dir(*z), gp_Dir(*x))
    names = ("XDirection", "YDirection")
    return origin, *(np.array(getattr(system, name)().Coord()) for name in names), system


def _list(kind: Any, values: Any, make: Any = float) -> Any:
    out = kind(1, len(values))
    for i, value in enumerate(values):
        out.SetValue(i + 1, make(value))
    return out


def _table(kind: Any, values: Floats, make: Any = float) -> Any:
    out = kind(1, values.shape[0], 1, values.shape[1])
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out.SetValue(i + 1, j + 1, make(values[i, j]))
    return out


def _spline(rng: np.random.Generator, *, rational: bool, size: int = 3) -> tuple[Any, Any]:
    distinct, mults = np.array([0.0, 0.4, 1.0]), [4, 1, 4]
    poles = rng.normal(size=(5, size))
    weights = rng.uniform(0.5, 2, 5) if rational else None
    record = curves.BSplineCurve(3, np.repeat(distinct, mults), poles, weights)
    points, kind, point = (
        (TColgp_Array1OfPnt, Geom_BSplineCurve, gp_Pnt)
        if size == 3
        else (TColgp_Array1OfPnt2d, Geom2d_BSplineCurve, gp_Pnt2d)
    )
    knots = (
        _list(TColStd_Array1OfReal, distinct.tolist()),
        _list(TColStd_Array1OfInteger, mults, int),
    )
    net = _list(points, poles, lambda each: point(*each))
    if weights is None:
        return record, kind(net, *knots, 3)
    return record, kind(net, _list(TColStd_Array1OfReal, weights.tolist()), *knots, 3)


def geom_curves(rng: np.random.Generator) -> dict[str, tuple[Any, Any]]:
    """Pairs of curves in space by name."""
    out: dict[str, tuple[Any, Any]] = {}
    origin, x, y, system = _curve_axes(rng)
    out["line"] = curves.Line(origin, x), Geom_Line(gp_Pnt(*origin), gp_Dir(*x))
    out["circle"] = curves.Circle(origin, x, y, 1.5, 1.5), Geom_Circle(system, 1.5)
    out["ellipse"] = curves.Ellipse(origin, x, y, 2.5, 0.75), Geom_Ellipse(system, 2.5, 0.75)
    out["hyperbola"] = curves.Hyperbola(origin, x, y, 1.5, 2), Geom_Hyperbola(system, 1.5, 2)
    out["parabola"] = curves.Parabola(origin, x, y, 0.4), Geom_Parabola(system, 0.4)
    out["b-spline"] = _spline(rng, rational=False)
    out["rational"] = _spline(rng, rational=True)
    z = rng.normal(size=3)
    z /= np.linalg.norm(z)
    basis, geom = out["b-spline"]
    out["offset"] = curves.OffsetCurve(basis, 0.3, z), Geom_OffsetCurve(geom, 0.3, gp_Dir(*z))
    return out


def pcurve_pairs(rng: np.random.Generator) -> dict[str, tuple[Any, Any]]:
    """Pairs of curves in parameters by name, circles of both hands."""
    out: dict[str, tuple[Any, Any]] = {}
    origin, along = rng.normal(size=(2, 2))
    x = along / np.linalg.norm(along)
    out["line"] = (
        curves.Line(origin, x),
        Geom2d_Line(gp_Pnt2d(*origin), gp_Dir2d(*x)),
    )
    for hand in (1, -1):
        y = hand * np.array([-x[1], x[0]])
        system = gp_Ax22d(gp_Pnt2d(*origin), gp_Dir2d(*x), gp_Dir2d(*y))
        out[f"circle {hand}"] = curves.Circle(origin, x, y, 1.5, 1.5), Geom2d_Circle(system, 1.5)
        geom = Geom2d_Ellipse(system, 2.5, 0.5)
        out[f"ellipse {hand}"] = curves.Ellipse(origin, x, y, 2.5, 0.5), geom
    out["b-spline"] = _spline(rng, rational=False, size=2)
    out["rational"] = _spline(rng, rational=True, size=2)
    basis, geom = out["circle -1"]
    out["offset"] = curves.OffsetCurve(basis, 0.3), Geom2d_OffsetCurve(geom, 0.3)
    return out


def _patch(rng: np.random.Generator, *, rational: bool) -> tuple[Any, Any]:
    u_knots, u_mults = np.array([0.0, 0.5, 1.0]), [4, 1, 4]
    v_knots, v_mults = np.array([0.0, 0.5, 1.0]), [3, 2, 3]
    poles = np.stack(np.meshgrid(np.arange(5), np.arange(5), [0], indexing="ij"), axis=-1)[:, :, 0]
    poles = poles + 0.2 * rng.normal(size=(5, 5, 3))
    weights = rng.uniform(0.5, 2, (5, 5)) if rational else None
    knots = np.repeat(u_knots, u_mults), np.repeat(v_knots, v_mults)
    record = surfaces.BSplineSurface((3, 2), knots, poles, weights)
    tail = (
        _list(TColStd_Array1OfReal, u_knots.tolist()),
        _list(TColStd_Array1OfReal, v_knots.tolist()),
        _list(TColStd_Array1OfInteger, u_mults, int),
        _list(TColStd_Array1OfInteger, v_mults, int),
        3,
        2,
    )
    net = _table(TColgp_Array2OfPnt, poles, lambda each: gp_Pnt(*each))
    if weights is None:
        return record, Geom_BSplineSurface(net, *tail)
    return record, Geom_BSplineSurface(net, _table(TColStd_Array2OfReal, weights), *tail)


def geom_surfaces(rng: np.random.Generator) -> dict[str, tuple[Any, Any]]:
    """Pairs of surfaces by name."""
    out: dict[str, tuple[Any, Any]] = {}
    *frame, system = axes(rng)
    out["plane"] = surfaces.Plane(*frame), Geom_Plane(system)
    out["cylinder"] = surfaces.Cylinder(*frame, 1.5), Geom_CylindricalSurface(system, 1.5)
    angle = float(rng.choice([0.4, -0.4]))
    out["cone"] = surfaces.Cone(*frame, 1.5, angle), Geom_ConicalSurface(system, angle, 1.5)
    out["sphere"] = surfaces.Sphere(*frame, 1.5), Geom_SphericalSurface(system, 1.5)
    out["torus"] = surfaces.Torus(*frame, 2.5, 0.5), Geom_ToroidalSurface(system, 2.5, 0.5)
    out["b-spline"] = _patch(rng, rational=False)
    out["rational"] = _patch(rng, rational=True)
    basis, geom = geom_curves(rng)["rational"]
    z = frame[2]
    swept = Geom_SurfaceOfLinearExtrusion(geom, gp_Dir(*z))
    out["extrusion"] = surfaces.Extrusion(basis, z), swept
    turned = Geom_SurfaceOfRevolution(geom, gp_Ax1(gp_Pnt(*frame[0]), gp_Dir(*z)))
    out["revolution"] = surfaces.Revolution(basis, frame[0], z), turned
    # The patch is only C0 at one of its knots, where OpenCascade offsets nothing.
    smooth = surfaces.Torus(*frame, 2.5, 0.5)
    out["offset"] = surfaces.Offset(smooth, 0.3), Geom_OffsetSurface(out["torus"][1], 0.3)
    record, patch = out["revolution"]
    out["offset of revolution"] = surfaces.Offset(record, 0.3), Geom_OffsetSurface(patch, 0.3)
    return out
