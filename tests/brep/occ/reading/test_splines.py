"""Curves and surfaces read in bulk: the numbers that OpenCascade gives one by one."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_Line,
)
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal

from ffdcli.brep.occ.reading.splines import curve_splines, surface_splines
from ffdcli.errors import KernelError

RANDOM = np.random.default_rng(7)


def array(kind, values):
    made = kind(1, len(values))
    for place, value in enumerate(values):
        made.SetValue(place + 1, value)
    return made


def reals(values):
    return array(TColStd_Array1OfReal, [float(value) for value in values])


def integers(values):
    return array(TColStd_Array1OfInteger, values)


def curve(knots, mults, degree, *, weights=None, periodic=False, flat=False):
    count = sum(mults[: -1 if periodic else None]) - (0 if periodic else degree + 1)
    points = RANDOM.random((count, 2 if flat else 3))
    point, poles, kind = (
        (gp_Pnt2d, TColgp_Array1OfPnt2d, Geom2d_BSplineCurve)
        if flat
        else (gp_Pnt, TColgp_Array1OfPnt, Geom_BSplineCurve)
    )
    poles = array(poles, [point(*place) for place in points.tolist()])
    basis = reals(knots), integers(mults), degree, periodic
    return kind(poles, *basis) if weights is None else kind(poles, reals(weights), *basis)


def surface(u_mults, v_mults, *, weighted=False):
    sizes = [sum(mults) - 4 for mults in (u_mults, v_mults)]
    poles, weights = (
        TColgp_Array2OfPnt(1, sizes[0], 1, sizes[1]),
        TColStd_Array2OfReal(1, sizes[0], 1, sizes[1]),
    )
    for i, j in np.ndindex(*sizes):
        poles.SetValue(i + 1, j + 1, gp_Pnt(*RANDOM.random(3).tolist()))
        weights.SetValue(i + 1, j + 1, 1 + RANDOM.random() if weighted else 1.0)
    knots = (reals(range(len(mults))) for mults in (u_mults, v_mults))
    return Geom_BSplineSurface(
        poles, weights, *knots, integers(u_mults), integers(v_mults), 3, 3, False, False
    )


def pole(shape, *place):
    """One homogeneous pole, as OpenCascade's bindings give it."""
    weight = shape.Weight(*place)
    return [*(weight * each for each in shape.Pole(*place).Coord()), weight]


def read(curves, dimension=3):
    batches = curve_splines(curves, dimension, lambda _: (2.0, 5.0), lambda n: f"edge {n}")
    return {
        int(number): (batch.degrees[0], batch.mults[0], batch.knots[0][row], batch.poles[row])
        for batch in batches
        for row, number in enumerate(batch.numbers)
    }


def test_curves_of_several_layouts_come_back_pole_by_pole():
    clamped = [
        curve([0, 0.5, 2], [4, 1, 4], 3),
        curve([0, 0.5, 2], [4, 2, 4], 3),
        curve([0, 0.25, 2], [4, 1, 4], 3),
        curve([0, 1], [3, 3], 2, weights=[1, 2, 3]),
    ]
    # One object on two edges.
    curves = dict(zip((9, 2, 5, 7), clamped, strict=True)) | {1: clamped[0]}
    found = read(curves)
    assert sorted(found) == [1, 2, 5, 7, 9]
    for number, one in curves.items():
        degree, mults, knots, poles = found[number]
        size = one.NbPoles()
        assert degree == one.Degree()
        assert mults.tolist() == [one.Multiplicity(i + 1) for i in range(one.NbKnots())]
        assert knots.tolist() == [one.Knot(i + 1) for i in range(one.NbKnots())]
        expected = [pole(one, i + 1)[: 4 if one.IsRational() else 3] for i in range(size)]
        assert poles.tolist() == expected


def test_loose_curves_are_clamped_and_keep_their_points():
    periodic = curve([0, 1, 2, 3], [1, 1, 1, 1], 2, periodic=True)
    open_ended = curve([0, 1, 2, 3, 4, 5], [1, 1, 1, 1, 1, 1], 2)
    clamped = curve([0, 1], [3, 3], 2)
    found = read({0: periodic, 1: open_ended, 2: clamped})
    for number, one in enumerate((periodic, open_ended, clamped)):
        degree, mults, knots, poles = found[number]
        assert mults[[0, -1]].tolist() == [degree + 1, degree + 1]
        ends = one.FirstParameter(), one.LastParameter()
        assert knots[[0, -1]].tolist() == pytest.approx(ends)
        for row, at in zip((0, -1), ends, strict=True):
            assert poles[row] == pytest.approx(one.Value(at).Coord())


def test_lines_and_bezier_curves_are_splines():
    line = Geom_Line(gp_Pnt(1, 2, 3), gp_Dir(0, 1, 0))
    poles = array(TColgp_Array1OfPnt, [gp_Pnt(*place) for place in np.eye(3).tolist()])
    found = read({4: line, 6: Geom_BezierCurve(poles)})
    assert found[4][0] == 1
    assert found[4][2].tolist() == [2, 5]
    assert found[4][3].tolist() == [[1, 4, 3], [1, 7, 3]]
    assert found[6][0] == 2
    assert found[6][3].tolist() == np.eye(3).tolist()
    with pytest.raises(KernelError, match="edge 3 is neither a line nor a B-spline: Circle"):
        read({3: Geom_Circle(gp_Ax2(), 1.0)})


def test_curves_in_parameters_have_two_coordinates():
    one = curve([0, 1, 3], [3, 1, 3], 2, flat=True, weights=[1, 2, 2, 1])
    ((degree, mults, knots, poles),) = read({0: one}, dimension=2).values()
    assert (degree, mults.tolist(), knots.tolist()) == (2, [3, 1, 3], [0, 1, 3])
    assert poles.tolist() == [pole(one, i + 1) for i in range(4)]


def test_surfaces_come_back_pole_by_pole():
    surfaces = {
        3: surface([4, 4], [4, 1, 4]),
        8: surface([4, 4], [4, 1, 4], weighted=True),
        1: surface([4, 2, 4], [4, 4]),
    }
    batches = surface_splines(surfaces)
    assert sorted(int(number) for batch in batches for number in batch.numbers) == [1, 3, 8]
    for batch in batches:
        for row, number in enumerate(batch.numbers):
            one = surfaces[int(number)]
            sizes = one.NbUPoles(), one.NbVPoles()
            expected = np.array([pole(one, i + 1, j + 1) for i, j in np.ndindex(*sizes)])
            components = batch.poles.shape[-1]
            assert components == (4 if number == 8 else 3)
            assert batch.poles[row].reshape(-1, components).tolist() == (
                expected[:, :components].tolist()
            )
            assert [len(mults) for mults in batch.mults] == [one.NbUKnots(), one.NbVKnots()]
