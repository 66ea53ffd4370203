"""Triangles cut along planes: areas add up, no piece is crossed, and few pieces arise."""

import numpy as np
import pytest

from ffdcli.deformation import Breaks
from ffdcli.verify.cut import cut_along


def twice_areas(corners):
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.fixture
def triangles():
    """Random ones with corners on planes, edges in planes, needles and points among them."""
    return np.random.default_rng(0).integers(-4, 5, size=(300, 3, 3)).astype(float)


def test_pieces_cover_their_triangle_and_cross_no_plane(triangles):
    values = (np.arange(-3, 4.0), np.arange(-4, 5.0), np.array([0.5]))
    owner, pieces = cut_along(triangles, [Breaks(np.zeros(3), np.eye(3), values)])
    whole, parts = twice_areas(triangles), twice_areas(pieces)
    for axis in range(3):
        found = np.bincount(owner, parts[:, axis], minlength=len(triangles))
        np.testing.assert_allclose(found, whole[:, axis], rtol=0, atol=1e-12)
        heights = pieces[:, :, axis]
        for value in values[axis]:
            below, above = heights.min(axis=1), heights.max(axis=1)
            assert not np.any((below < value - 1e-12) & (above > value + 1e-12))
    # None is turned over.
    assert np.einsum("ij,ij->i", parts, whole[owner]).min() > -1e-12


def test_turned_and_moved_planes_cut_as_their_own_axes_say(triangles):
    turn = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([3.0, -2.0, 7.0])
    values = (np.arange(-3, 4.0), np.arange(-4, 5.0), np.array([0.5]))
    moved = triangles @ turn + origin
    owner, pieces = cut_along(moved, [Breaks(origin, turn, values)])
    local = (pieces - origin) @ turn.T
    for axis in range(3):
        for value in values[axis]:
            below, above = local[:, :, axis].min(axis=1), local[:, :, axis].max(axis=1)
            assert not np.any((below < value - 1e-12) & (above > value + 1e-12))
    areas = np.linalg.norm(twice_areas(pieces), axis=1)
    whole = np.linalg.norm(twice_areas(moved), axis=1)
    np.testing.assert_allclose(np.bincount(owner, areas, minlength=300), whole, atol=1e-12)


def test_a_grid_of_planes_gives_few_pieces():
    """Ninety-nine planes each way have 10,000 cells; each is cut into eight pieces at most."""
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0.0]]])
    planes = np.linspace(0, 1, 101)[1:-1]
    breaks = Breaks(np.zeros(3), np.eye(3), (planes, planes, np.zeros(0)))
    owner, pieces = cut_along(square, [breaks])
    assert len(pieces) <= 8 * 100 * 100
    areas = np.bincount(owner, twice_areas(pieces)[:, 2]) / 2
    np.testing.assert_allclose(areas, 0.5, rtol=1e-13)
