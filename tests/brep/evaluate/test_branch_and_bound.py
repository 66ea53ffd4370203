"""Nearest points by bounds, against dense grids of scipy's B-splines."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import NdBSpline
from scipy.spatial import cKDTree

from ffdcli.brep.evaluate.branch_and_bound import SHARE, Sheets, search_all
from ffdcli.brep.evaluate.nearest import WITHIN, Solver, unknown

DEGREE = 3
KNOTS = np.repeat([0.0, 1.0], DEGREE + 1)
GRID = np.stack(np.meshgrid(*2 * [np.linspace(0, 1, 400)]), axis=-1).reshape(-1, 2)


def sheet(poles, exact):
    """Searches of one Bézier patch with homogeneous poles, trimmed to u + v < 1.2."""
    spline = NdBSpline((KNOTS, KNOTS), poles, (DEGREE, DEGREE))

    def evaluate(_, uv):
        values = spline(uv)
        slopes = np.stack([spline(uv, nu=order) for order in ((1, 0), (0, 1))], axis=1)
        point = values[:, :3] / values[:, 3:]
        tangents = slopes[..., :3] - point[:, None] * slopes[..., 3:]
        return point, tangents / values[:, None, 3:]

    def at(_, uv):
        values = spline(uv)
        return values if exact else np.pad(values[:, :3] / values[:, 3:], ((0, 0), (0, 1)),
                                           constant_values=1.0)  # fmt: skip

    def accept(_, uv):
        return uv.sum(axis=1) < 1.2

    sheets = Sheets(
        np.zeros((1, 2)), np.ones((1, 2)), at, DEGREE if exact else 6, exact,
        lambda uv: uv, lambda _, low, high: low.sum(axis=1) < 1.2,
    )  # fmt: skip
    solver = Solver(evaluate, lambda _, uv: np.clip(uv, 0, 1), accept, 1e-14, 1e-9)
    kept = GRID[accept(None, GRID)]
    return sheets, solver, evaluate(None, kept)[0]


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("weights", [(1, 1), (0.3, 6)])
@pytest.mark.parametrize("seed", range(4))
def test_distances_and_bounds_agree_with_a_dense_grid(seed, weights, exact):
    random = np.random.default_rng(seed)
    poles = np.ones((4, 4, 4))
    poles[..., :3] = random.normal(size=(4, 4, 3))
    poles *= random.uniform(*weights, size=(4, 4, 1))
    sheets, solver, dense = sheet(poles, exact)
    points = np.vstack([random.normal(size=(20, 3)), dense[:: len(dense) // 20]])
    found = search_all(sheets, solver, points, unknown(len(points), 2), 0.02)
    true, _ = cKDTree(dense).query(points)
    # A grid point is at most its spacing from the nearest.
    slack = 0.03
    far = true > 0.02 + slack
    assert np.all(found.distance[far] <= true[far] / SHARE)
    assert np.all(found.distance >= true - slack)
    assert np.all(found.least <= true)
    assert np.all(found.least[far] >= SHARE * (true[far] - slack))
    assert np.all(found.distance[-20:] <= 0.02)


def test_a_file_with_nothing_is_proved_to_be_infinitely_far():
    nothing = np.zeros((0, 2))
    sheets = Sheets(nothing, nothing, lambda _, uv: np.ones((len(uv), 4)), 1, True, lambda uv: uv,
                    lambda piece, _low, _high: np.ones(len(piece), dtype=bool))  # fmt: skip
    solver = Solver(None, None, None, 0.0, 0.0)
    found = search_all(sheets, solver, np.zeros((1, 3)), unknown(1, 2), 1.0)
    assert found.least.tolist() == [np.inf]


def test_beyond_the_distance_allowed_all_points_are_searched_long_and_few_within():
    count = 5000
    distance = np.linspace(0, 1, count)
    feet = replace(unknown(count, 2), distance=distance)
    solver = Solver(None, None, None, 0.0, 1e-3, allowed=0.9)
    worst = solver.worst_of(feet)
    assert (distance[worst] > 0.9).sum() == (distance > 0.9).sum()
    assert len(worst) == (distance > 0.9).sum() + WITHIN
    assert np.all(np.diff(distance[worst]) < 0)
    everything = replace(solver, allowed=0.0).worst_of(feet)
    assert len(everything) == (distance > 1e-3).sum()
