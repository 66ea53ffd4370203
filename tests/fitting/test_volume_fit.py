"""Fitting a polynomial volume to a deformation known by its values alone."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from ffdcli.fitting.least_squares import solve_least_squares
from ffdcli.fitting.levels import OPEN, around, cells_of, codes_of, functions_on
from ffdcli.fitting.spread import Surface
from ffdcli.fitting.volume_fit import FOUND, Field, fit_field
from ffdcli.volume.adaptive.octree import interleave, separate
from support.volume_trees import BOX, FRAME, ball

NOTHING = (np.zeros((0, 3)), np.zeros((0, 3)))


def cells(level):
    """All cells of a level."""
    return {level: np.arange(8**level)}


def passed(surface, level):
    """Cells of a level that a surface passes."""
    return {level: np.unique(codes_of(surface.points(level, 200.0, seed=9), level))}


def wave(places):
    """Smooth on the left half; only twice differentiable across the middle."""
    x, y, z = places.T
    bend = np.maximum(x - 0.5, 0) ** 3
    return np.stack([bend, 0.1 * np.sin(3 * y) * z, bend * y], axis=1)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_values_are_those_of_uniform_splines(degree):
    places = np.random.default_rng(0).random((40, 3))
    functions = functions_on(cells(1) | cells(2), degree)
    firsts, levels = functions.firsts
    expected = np.ones((len(places), functions.count))
    for column, (first, level) in enumerate(zip(firsts, levels, strict=True)):
        for axis in range(3):
            knots = (first[axis] + np.arange(degree + 2)) / 2.0**level
            element = BSpline.basis_element(knots, extrapolate=False)
            expected[:, column] *= np.nan_to_num(element(places[:, axis]))
    found = functions.matrix(places).toarray()
    assert np.abs(found - expected).max() < 1e-13
    assert np.array_equal(np.sort(functions.order), np.arange(functions.count))


def test_cells_around_others():
    codes = interleave(np.array([[0, 3, 7]]))
    near = separate(around(codes, 3, 2))
    expected = {(i, j, k) for i in range(3) for j in range(1, 6) for k in (5, 6, 7)}
    assert set(map(tuple, near.tolist())) == expected


def test_least_squares_in_one_block_or_many(monkeypatch):
    import ffdcli.fitting.least_squares as module

    random = np.random.default_rng(1)
    entries = random.standard_normal((900, 300)) * (random.random((900, 300)) < 0.03)
    matrix = csr_array(entries)
    wanted = random.standard_normal((900, 3))
    expected = np.linalg.lstsq(matrix.toarray(), wanted, rcond=None)[0]
    for block in (300, 70):
        monkeypatch.setattr(module, "_ONE_BLOCK", block)
        monkeypatch.setattr(module, "_BLOCK", block)
        found = solve_least_squares(matrix, wanted, random.permutation(300))
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_points_are_spread_evenly_and_kept_apart():
    surface = Surface(ball())
    places = surface.points(4, 30.0, seed=1)
    assert np.abs(np.linalg.norm(places - 0.5, axis=1) - 0.3).max() < 0.01
    other = surface.points(4, 30.0, seed=2)
    assert len(np.unique(np.concatenate([places, other]), axis=0)) == 2 * len(places)
    half = (places[:, 2] > 0.5).mean()
    assert abs(half - 0.5) < 0.01


def test_part_of_a_surface_in_some_cells_misses_none_of_it():
    large = Surface(np.array([[[0.05, 0.1, 0.2], [0.95, 0.2, 0.3], [0.4, 0.9, 0.8]]]))
    places = large.points(5, 20.0, seed=0)
    inside = places[np.all(cells_of(places, 3) == [3, 2, 2], axis=1)]
    assert len(inside) > 20
    codes = interleave(np.array([[3, 2, 2]]))
    part = large.meeting(codes, 3)
    assert len(part.triangles) < 200
    # Every point lies on one of the parts: its barycentric coordinates there are a partition.
    corner = part.triangles[:, 0]
    sides = np.swapaxes(part.triangles[:, 1:] - part.triangles[:, :1], 1, 2)
    share = np.einsum("tij,ptj->pti", np.linalg.pinv(sides), inside[:, None] - corner)
    held = (share.min(axis=2) >= -1e-12) & (share.sum(axis=2) <= 1 + 1e-12)
    assert held.any(axis=1).all()


def test_a_polynomial_is_fitted_at_once():
    surface = Surface(ball())

    def cubic(places):
        x, y, z = places.T
        return np.stack([x * y * z, x**3 - y**2, z**3 * x], axis=1)

    leaves = passed(surface, 2)
    beside = np.random.default_rng(0).random((3000, 3))
    beside = beside[np.isin(codes_of(beside, 2), leaves[2])]
    done = fit_field(Field(cubic, surface, (beside, cubic(beside)), OPEN), leaves, 1e-3, 4)
    assert len(done.stages) == 1
    assert done.error < 3e-4
    # Also beside the surface, where nothing but those places says what to be.
    volume = done.volume(BOX, FRAME)
    moved = volume.evaluate(beside * BOX[1]) - beside * BOX[1]
    assert np.abs(moved - cubic(beside)).max() < 3e-2


@pytest.fixture(scope="module")
def fitted():
    surface = Surface(ball())
    return surface, fit_field(Field(wave, surface, NOTHING, OPEN), passed(surface, 2), 1e-5, 7)


def test_the_bound_holds_at_points_of_other_seeds(fitted):
    surface, done = fitted
    assert done.bound == done.error / FOUND <= 1e-5
    # Finer cells only where the third derivative jumps, and there as many levels as it takes.
    assert done.levels[1] > 2
    places = surface.points(6, 20.0, seed=123)
    volume = done.volume(BOX, FRAME)
    moved = volume.evaluate(places * BOX[1]) - places * BOX[1]
    off = np.linalg.norm(moved - wave(places), axis=1)
    assert off.max() <= done.bound
    # Not so loose that it says nothing.
    assert off.max() > done.error / 3


def test_fine_cells_are_where_they_are_needed(fitted):
    surface, done = fitted
    finest = done.levels[1]
    codes = np.concatenate([stage[finest] for stage in done.cells if finest in stage])
    assert 0 < len(codes) < len(passed(surface, finest)[finest]) / 4


def test_cells_of_a_fit_serve_other_deformations(fitted):
    """The fit is linear in what it fits."""
    surface, done = fitted

    def double(places):
        return -2 * wave(places)

    leaves = passed(surface, 2)
    again = fit_field(Field(double, surface, NOTHING, OPEN), leaves, 1e-10, 7, done.cells)
    assert again.error == pytest.approx(2 * done.error, rel=1e-6)
    places = surface.points(4, 5.0, seed=5) * BOX[1]
    moves, other = (each.volume(BOX, FRAME).evaluate(places) - places for each in (done, again))
    assert np.abs(-2 * moves - other).max() < 1e-9


def test_what_does_not_move_is_left_alone():
    surface = Surface(ball())

    def left(places):
        return np.maximum(0.4 - places[:, :1], 0.0) ** 4 * [1.0, 2.0, -1.0]

    done = fit_field(Field(left, surface, NOTHING, OPEN), passed(surface, 3), 1e-5, 6)
    far = surface.points(3, 20.0, seed=3)
    far = far[far[:, 0] > 0.8] * BOX[1]
    assert np.array_equal(done.volume(BOX, FRAME).evaluate(far), far)


def test_the_bound_tells_where_levels_run_out():
    surface = Surface(ball())
    done = fit_field(Field(wave, surface, NOTHING, OPEN), passed(surface, 2), 1e-7, 3)
    assert done.bound > 1e-7
    assert done.levels[1] == 3


def test_nothing_to_fit_is_the_identity():
    surface = Surface(ball())
    done = fit_field(Field(np.zeros_like, surface, NOTHING, OPEN), passed(surface, 2), 1e-5, 4)
    places = surface.points(2, 5.0, seed=0) * BOX[1]
    assert done.error == 0
    assert np.array_equal(done.volume(BOX, FRAME).evaluate(places), places)
