"""Evaluation of B-spline curves and surfaces, against scipy."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.brep.evaluate.bspline import (
    CurveBatch,
    SurfaceBatch,
    basis,
    curve_points,
    groups,
    surface_points,
    surface_positions,
)

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize(("degree", "mults"), [(1, [2, 1, 2]), (3, [4, 2, 1, 4]), (9, [10, 10])])
def test_basis_is_that_of_scipy_with_its_slopes(degree, mults):
    knots = np.sort(RANDOM.random((40, len(mults))), axis=1)
    at = knots[:, 0] + RANDOM.random(40) * (knots[:, -1] - knots[:, 0])
    at[:3] = knots[0, 0], knots[1, -1], knots[2, 1]
    first, values, slopes = basis(degree, knots, np.array(mults), at)
    assert np.allclose(values.sum(axis=1), 1, atol=1e-14)
    size = sum(mults) - degree - 1
    for row in range(40):
        spline = BSpline(np.repeat(knots[row], mults), np.eye(size), degree)
        ours = np.zeros((2, size))
        reach = slice(first[row], first[row] + degree + 1)
        ours[:, reach] = values[row], slopes[row]
        assert np.allclose(ours[0], spline(at[row]), atol=1e-12)
        if degree > 1:
            expected = spline.derivative()(at[row])
            assert np.allclose(ours[1], expected, atol=1e-10 * np.abs(expected).max())


def test_quarter_circle_as_a_rational_curve_has_unit_radius_and_right_tangents():
    half = np.sqrt(0.5)
    poles = np.array([[[1, 0, 0, 1], [half, half, 0, half], [0, 1, 0, 1]]])
    batch = CurveBatch(np.array([0]), 2, np.array([[0.0, 1.0]]), np.array([3, 3]), poles, True)
    at = np.linspace(0, 1, 9)
    points, tangents = curve_points(batch, np.zeros(9, dtype=int), at)
    assert np.allclose(np.linalg.norm(points, axis=1), 1, atol=1e-15)
    assert np.allclose((points * tangents[:, 0]).sum(axis=1), 0, atol=1e-15)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("inner", [True, False])
def test_surfaces_are_tensor_products_with_their_slopes(rational, inner):
    poles = RANDOM.random((2, 5 if inner else 3, 4, 3 + rational)) + 1
    mults_u, mults_v = np.array([3, 1, 1, 3] if inner else [3, 3]), np.array([4, 4])
    u_knots = np.array([[0, 0.3, 0.7, 1], [1, 1.5, 2.5, 3.0]])
    u_knots = u_knots if inner else u_knots[:, [0, -1]]
    v_knots = np.array([[0.0, 1], [-1, 4.0]])
    batch = SurfaceBatch(np.arange(2), (2, 3), u_knots, v_knots, mults_u, mults_v, poles, rational)
    rows = np.array([0, 1, 1, 0])
    uv = np.array([[0.4, 0.2], [1.2, 3.0], [3.0, -1.0], [0.9, 0.9]])
    points, tangents = surface_points(batch, rows, uv)
    step = 1e-6
    assert np.allclose(surface_positions(batch, rows, uv), points, atol=1e-14)
    for k, row in enumerate(rows):
        u = BSpline(np.repeat(u_knots[row], mults_u), np.eye(poles.shape[1]), 2)(uv[k, 0])
        v = BSpline(np.repeat(v_knots[row], mults_v), np.eye(4), 3)(uv[k, 1])
        value = np.einsum("i,j,ijk->k", u, v, poles[row])
        expected = value[:3] / value[3] if rational else value
        assert np.allclose(points[k], expected, atol=1e-14)
    for axis in (0, 1):
        shift = step * np.eye(2)[axis]
        high, _ = surface_points(batch, rows, uv + shift)
        low, _ = surface_points(batch, rows, uv - shift)
        assert np.allclose(tangents[:, axis], (high - low) / (2 * step), atol=1e-7)


def test_groups_name_every_index_once():
    keys = np.array([2, -1, 2, 0, -1])
    assert [(key, part.tolist()) for key, part in groups(keys)] == [
        (-1, [1, 4]),
        (0, [3]),
        (2, [0, 2]),
    ]
    assert list(groups(np.zeros(0, dtype=int))) == []
