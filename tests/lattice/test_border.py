"""Borders: which sides the mesh crosses, and what their locked layers hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import PPoly
from scipy.optimize import linprog

from ffdcli.lattice import parse_spec
from ffdcli.lattice.border import SIDES, crossed_sides, lock_layers, touches_box
from ffdcli.splines.knots import make_knots

UNIT = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])


def triangle(*corners):
    return np.array([corners], dtype=float)


@pytest.mark.parametrize("ends", ["clamped", "unclamped"])
@pytest.mark.parametrize("border", ["c0", "c1", "c2"])
@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("side", SIDES[:2])
def test_locked_layers_hold_value_and_derivatives_at_the_side(ends, border, degree, side):
    count = degree + 4
    spec = parse_spec(
        {
            "version": 1,
            "degree": [degree, 1, 1],
            "points": [count, 2, 2],
            "ends": ends,
            "border": border,
        }
    )
    locked = lock_layers(spec, (side,)).locked[:, 0, 0]
    knots = make_knots(degree, count, 0.0, 1.0, interior=None, clamped=ends == "clamped")
    wholes = [PPoly.from_spline((knots, one, degree)) for one in np.eye(count)]
    # One-sided derivatives, those of the pieces inside the box.
    inside = np.stack([whole.c[:, degree:count] for whole in wholes], axis=-1)
    pieces = PPoly(inside, knots[degree : count + 1])
    at = 0.0 if side == "u_min" else 1.0
    orders = range(min(int(border[1]), degree) + 1)

    def felt(free):
        return max(np.abs(pieces.derivative(r)(at)[free]).max(initial=0.0) for r in orders)

    assert felt(~locked) < 1e-12
    innermost = np.flatnonzero(locked)[-1 if side == "u_min" else 0]
    one_fewer = locked & (np.arange(count) != innermost)
    assert felt(~one_fewer) > 1e-3


def test_sides_can_differ():
    spec = parse_spec({"version": 1, "points": [6, 6, 6], "border": {"u_min": "c0", "v_max": "c2"}})
    border = lock_layers(spec, ("u_min", "v_max", "w_min"))
    assert border.layers == (1, 0, 0, 3, 2, 0)
    assert border.crossed == ("u_min", "v_max", "w_min")
    free = np.argwhere(~border.locked)
    assert free.min(axis=0).tolist() == [1, 0, 2]
    assert free.max(axis=0).tolist() == [5, 2, 5]
    assert border.sides_of((0, 3, 1)) == ("u_min", "v_max", "w_min")
    assert border.sides_of((1, 2, 1)) == ("w_min",)


def test_a_mesh_in_the_box_crosses_nothing():
    inside = triangle([0, 0, 0], [1, 0, 0], [0, 1, 1])
    assert crossed_sides(inside, UNIT, 1e-9) == ()
    assert crossed_sides(inside * (1 + 1e-10), UNIT, 1e-9) == ()


def test_a_triangle_through_a_side_crosses_it_alone():
    through = triangle([0.5, 0.5, 0.5], [0.6, 0.5, 0.5], [0.5, 0.5, 1.5])
    assert crossed_sides(through, UNIT, 1e-9) == ("w_max",)


def test_a_triangle_that_touches_a_side_from_outside_crosses_it():
    outside = triangle([0.2, 0.2, 0], [0.8, 0.2, 0], [0.5, 0.5, -1])
    assert crossed_sides(outside, UNIT, 1e-9) == ("w_min",)


def test_a_large_triangle_past_a_corner_of_the_box_crosses_nothing():
    # Its bounding box holds the lattice box, the triangle itself passes by.
    beside = triangle([3.1, 0, -1.5], [0, 3.1, -1.5], [3.1, 3.1, 1.6])
    assert crossed_sides(beside, UNIT, 1e-9) == ()


def test_a_plate_in_a_side_plane_crosses_the_sides_it_passes():
    plate = np.concatenate(
        [
            triangle([-1, -1, 0], [2, -1, 0], [2, 2, 0]),
            triangle([-1, -1, 0], [2, 2, 0], [-1, 2, 0]),
        ]
    )
    assert crossed_sides(plate, UNIT, 1e-9) == ("u_min", "u_max", "v_min", "v_max")


coordinate = st.floats(-2, 3).map(lambda x: np.float64(np.float32(x)))


@given(arrays(np.float64, (3, 3), elements=coordinate))
def test_touching_agrees_with_linear_programming(corners):
    # The least t for which the box grown by t holds a point of the triangle.
    combination = np.vstack([corners.T, np.ones(3)])
    upper = np.column_stack([corners.T, -np.ones(3)])
    lower = np.column_stack([-corners.T, -np.ones(3)])
    found = linprog(
        [0, 0, 0, 1],
        A_ub=np.vstack([upper, lower]),
        b_ub=np.concatenate([UNIT[1], -UNIT[0]]),
        A_eq=np.append(combination[3], 0)[None],
        b_eq=[1],
        bounds=[(0, 1)] * 3 + [(None, None)],
    )
    if abs(found.fun - 0.1) > 1e-6:
        assert bool(touches_box(corners[None], UNIT, 0.1)[0]) == (found.fun < 0.1)
