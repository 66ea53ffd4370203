"""Curves: points, derivatives and breaks against OpenCascade's own evaluation."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.part import curves
from tests.support.geom_models import axes, geom_curves, pcurve_pairs

NAMES = ["line", "circle", "ellipse", "hyperbola", "parabola", "b-spline", "rational", "offset"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_points_and_derivatives_in_space(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    record, geom = geom_curves(rng)[name]
    at = rng.uniform(0.02, 0.98, 25)
    order = 2 if name == "offset" else 3
    known = record.derivatives(at, order)
    assert np.array_equal(record.points(at), record.derivatives(at, 0)[0])
    for t, *found in zip(at, *known, strict=True):
        point = geom.Value(t)
        wanted = [point.Coord(), *(geom.DN(t, n).Coord() for n in range(1, order + 1))]
        for n, (mine, theirs) in enumerate(zip(found, wanted, strict=True)):
            scale = 1 + np.abs(theirs).max()
            assert np.abs(mine - theirs).max() <= 1e-12 * 10**n * scale


@pytest.mark.parametrize("seed", range(3))
def test_points_and_derivatives_in_parameters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = rng.uniform(0.02, 0.98, 25)
    for name, (record, geom) in pcurve_pairs(rng).items():
        known = record.derivatives(at, 1)
        for t, point, slope in zip(at, *known, strict=True):
            assert np.abs(point - geom.Value(t).Coord()).max() <= 1e-12, name
            wanted = np.array(geom.DN(t, 1).Coord())
            assert np.abs(slope - wanted).max() <= 1e-11 * (1 + np.abs(wanted).max()), name


def test_a_periodic_spline_goes_on_beyond_its_domain() -> None:
    knots = np.array([0.0, 0, 0, 1, 2, 3, 3, 3])
    poles = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.0, 0]])
    curve = curves.BSplineCurve(2, knots, poles, period=3.0, closing=1)
    at = np.array([-2.5, 0.5, 3.5])
    points = curve.points(at)
    assert np.allclose(points, points[1], atol=1e-15)
    found = curve.breaks(-1.5, 3.5)
    assert found.values.tolist() == [-1, 0, 1, 2, 3]
    assert found.continuity.tolist() == [1, 1, 1, 1, 1]
    offset = curves.OffsetCurve(curve, 0.1)
    assert offset.breaks(-1.5, 3.5).continuity.tolist() == [0] * 5
    assert curves.Line(np.zeros(2), np.ones(2)).breaks(0, 9).values.size == 0


def test_axes_of_the_models_are_of_both_hands() -> None:
    rng = np.random.default_rng(0)
    hands = {round(float(np.linalg.det(np.stack(axes(rng)[1:4])))) for _ in range(20)}
    assert hands == {1, -1}
