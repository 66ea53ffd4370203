"""Geometry of the mouse, against scipy and against a camera written out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("viser")

from ffdcli.editor.page.picking import (
    inside_rectangle,
    number_text,
    numbers,
    turn_about_axis,
    turn_matrix,
    turn_quaternion,
)
from ffdcli.errors import FfdError


def test_quaternions_are_scipys():
    for turn in Rotation.random(20, random_state=1):
        wxyz = turn.as_quat(scalar_first=True)
        assert np.allclose(turn_matrix(3 * wxyz), turn.as_matrix(), atol=1e-14)
        back = turn_matrix(turn_quaternion(turn.as_matrix()))
        assert np.allclose(back, turn.as_matrix(), atol=1e-14)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("degrees", [-170.0, -30.0, 0.5, 45.0, 120.0])
def test_turns_about_one_axis_are_found(axis, degrees):
    turn = Rotation.from_euler("xyz"[axis], degrees, degrees=True).as_matrix()
    found, angle = turn_about_axis(turn)
    assert found == axis
    assert angle == pytest.approx(degrees, abs=1e-10)


def test_points_in_a_rectangle_of_the_screen():
    # The camera stands at (0, 0, 5) and looks down; its right is the model's x, its down is -y.
    view = {
        "position": np.array([0.0, 0.0, 5.0]),
        "wxyz": np.array([0.0, 1.0, 0.0, 0.0]),
        "fov": np.pi / 2,
        "aspect": 2.0,
    }
    points = np.array(
        [[0.0, 0, 0], [4.9, 0, 0], [-4.9, 4.9, 0], [10.1, 0, 0], [0, 0, 6.0], [0, 5.1, 0]]
    )
    whole = inside_rectangle(points, (0.0, 0.0), (1.0, 1.0), **view)
    assert whole.tolist() == [True, True, True, False, False, False]
    # Upper left quarter: x < 0 and y > 0 of the model.
    quarter = inside_rectangle(points, (0.0, 0.0), (0.499, 0.499), **view)
    assert quarter.tolist() == [False, False, True, False, False, False]


def test_numbers_are_read_as_they_are_typed():
    assert numbers("1, -2.5 3e-3", 3, "Point") == [1.0, -2.5, 0.003]
    assert numbers("0.1", 1, "Height") == [0.1]
    assert number_text([1.0, -2.5, 1 / 3]) == "1, -2.5, 0.333333333333"


@pytest.mark.parametrize("text", ["", "1, 2", "1, 2, 3, 4", "a, b, c", "1, 2, nan", "1, 2, inf"])
def test_what_is_no_number_is_refused(text):
    with pytest.raises(FfdError, match=r"Point: .* is not 3 numbers"):
        numbers(text, 3, "Point")
