"""The smallest change of weights: targets met, bounds kept, no better one found."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

from ffdcli.lattice.drag.reweigh import FLOOR, reweigh
from ffdcli.volume.weights import rational_basis


def problem(seed, sources):
    rng = np.random.default_rng(seed)
    values = rng.uniform(0.01, 1, size=(sources, 30))
    basis = csr_array(values / values.sum(axis=1, keepdims=True))
    points = rng.normal(size=(30, 3))
    weights = rng.uniform(0.5, 2, size=30)
    # A place that some weights within the bounds reach.
    goal = weights * rng.uniform(0.05, 3, size=30)
    targets = rational_basis(basis, goal) @ points
    return basis, points, weights, targets, goal


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_targets_are_met_within_the_bounds_by_the_least_change(seed, sources):
    basis, points, weights, targets, goal = problem(seed, sources)
    found = reweigh(basis, points, weights, np.ones(30, dtype=bool), targets)
    assert found.met
    assert np.all(found.weights >= FLOOR * weights)
    images = rational_basis(basis, found.weights) @ points
    np.testing.assert_allclose(images, targets, atol=1e-12)
    # The problem is convex, so nothing on the way to any other solution may be shorter. All
    # multiples of `goal` within the bounds are solutions.
    change = found.weights - weights
    for factor in (0.5, 1, 2):
        other = factor * goal
        if np.all(other >= FLOOR * weights):
            assert change @ (other - found.weights) >= -1e-9


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_scipy_finds_nothing_smaller(seed):
    basis, points, weights, targets, goal = problem(seed, 2)
    found = reweigh(basis, points, weights, np.ones(30, dtype=bool), targets)
    dense = basis.toarray()
    rows = np.vstack([(dense[s][:, None] * (points - targets[s])).T for s in range(2)])
    other = scipy.optimize.minimize(
        lambda w: ((w - weights) ** 2).sum(),
        goal,
        jac=lambda w: 2 * (w - weights),
        bounds=[(FLOOR * w, None) for w in weights],
        constraints={"type": "eq", "fun": lambda w: rows @ w, "jac": lambda w: rows},
        method="SLSQP",
        options={"maxiter": 1000, "ftol": 1e-12},
    )
    assert ((found.weights - weights) ** 2).sum() <= other.fun * (1 + 1e-6) + 1e-9


def test_bounds_become_active_exactly():
    basis = csr_array(np.full((1, 8), 1 / 8))
    points = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    found = reweigh(basis, points, np.ones(8), np.ones(8, dtype=bool), np.array([[0.9, 0.9, 0.9]]))
    assert found.met
    assert np.count_nonzero(found.weights == FLOOR) >= 3
    np.testing.assert_allclose(
        rational_basis(basis, found.weights) @ points, [[0.9, 0.9, 0.9]], atol=1e-14
    )


def test_a_target_outside_the_hull_is_told_with_its_distance():
    basis = csr_array(np.full((2, 8), 1 / 8))
    points = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    targets = np.array([[0.5, 0.5, 1.25], [0.5, 0.5, 0.5]])
    found = reweigh(basis, points, np.ones(8), np.ones(8, dtype=bool), targets)
    assert not found.met
    assert found.beyond == pytest.approx([0.25, 0])
    assert np.all(found.weights >= FLOOR)


def test_weights_that_are_not_free_stay():
    basis, points, weights, targets, _ = problem(4, 1)
    free = np.arange(30) % 3 > 0
    found = reweigh(basis, points, weights, free, targets)
    assert found.met
    assert np.array_equal(found.weights[~free], weights[~free])
    none = reweigh(basis, points, weights, np.zeros(30, dtype=bool), targets)
    assert not none.met
    assert np.array_equal(none.weights, weights)
