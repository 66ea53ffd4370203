"""Inside or outside, against solids whose inside is known; nearest points, against samples."""

import numpy as np
import pytest
import trimesh

from ffdcli.mesh.winding import nearest_on_triangles, winding_numbers


def test_winding_numbers_of_a_box_and_of_one_turned_inside_out():
    corners = trimesh.creation.box((1, 2, 3)).triangles
    points = np.array([[0.3, 0.9, 1.4], [0.3, 0.9, 1.6], [-0.4, 0, 0], [9, 9, 9]])
    assert winding_numbers(points, corners) == pytest.approx([1, 0, 1, 0], abs=1e-12)
    assert winding_numbers(points, corners[:, ::-1]) == pytest.approx([-1, 0, -1, 0], abs=1e-12)
    assert winding_numbers(points[:0], corners).shape == (0,)


def test_winding_numbers_of_many_points_agree_with_a_torus():
    corners = trimesh.creation.torus(2, 0.7, major_sections=64, minor_sections=48).triangles
    points = np.random.default_rng(0).uniform(-3, 3, (600, 3)) * [1, 1, 0.4]
    ring = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 2, points[:, 2])
    clear = np.abs(ring - 0.7) > 0.03
    found = winding_numbers(points, corners)
    assert found == pytest.approx(np.round(found), abs=1e-9)
    assert np.array_equal(found[clear] > 0.5, ring[clear] < 0.7)


def test_nearest_places_are_on_the_triangles_and_nearest():
    rng = np.random.default_rng(1)
    corners, points = rng.normal(size=(40, 3, 3)), rng.normal(size=(40, 3))
    near = nearest_on_triangles(points, corners)
    shares = rng.dirichlet(np.ones(3) * 0.4, size=(40, 500))
    others = np.einsum("nsk,nkc->nsc", shares, corners)
    distance = np.linalg.norm(near - points, axis=1)
    assert np.all(distance <= np.linalg.norm(others - points[:, None], axis=2).min(axis=1) + 1e-12)
    # On the triangle: its three parts add up to it.
    rolled = np.roll(corners, -1, axis=1)
    parts = np.linalg.norm(np.cross(corners - near[:, None], rolled - near[:, None]), axis=2).sum(1)
    whole = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert parts == pytest.approx(whole, rel=1e-9)
