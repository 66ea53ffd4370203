"""Least-norm moves of control points: shortest, equal to the pseudo-inverse, dependent or not."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

from ffdcli.lattice.drag.least_norm import TooManyConstraints, factor, free_rows
from ffdcli.splines.knots import greville, make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame
from ffdcli.volume.weights import homogeneous, rational_basis

SEEDS = st.integers(0, 2**32 - 1)


def volume(counts=(5, 6, 7), degrees=(2, 3, 3)):
    knots = tuple(
        make_knots(k, n, 0.0, 1.0, interior=None, clamped=True)
        for k, n in zip(degrees, counts, strict=True)
    )
    axes = [greville(t, k) for t, k in zip(knots, degrees, strict=True)]
    net = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return BSplineVolume(degrees, knots, net, Frame(np.zeros(3), np.eye(3)))


def constraints(seed, count):
    rng = np.random.default_rng(seed)
    sources = rng.uniform(size=(count, 3))
    weights = rng.uniform(0.3, 3, size=5 * 6 * 7)
    rows = rational_basis(volume().basis_matrix(sources), weights)
    return rows, rng.normal(size=(count, 3))


def moves(rows, wanted):
    return rows.T @ factor(rows).multipliers(wanted)


@given(SEEDS, st.integers(1, 12))
def test_rational_basis_is_a_partition_of_unity_that_the_volume_agrees_with(seed, count):
    rng = np.random.default_rng(seed)
    box, sources = volume(), rng.uniform(size=(count, 3))
    weights = rng.uniform(0.3, 3, size=box.shape)
    points = box.net + 0.1 * rng.normal(size=box.net.shape)
    rows = rational_basis(box.basis_matrix(sources), weights.ravel())
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-14)
    images = box.with_net(homogeneous(points, weights)).evaluate(sources)
    np.testing.assert_allclose(rows @ points.reshape(-1, 3), images, atol=1e-13)


def test_equal_weights_cancel():
    points = np.arange(24.0).reshape(2, 2, 2, 3)
    assert homogeneous(points, np.full((2, 2, 2), 3.0)) is points
    rows = volume().basis_matrix(np.full((1, 3), 0.3))
    assert rational_basis(rows, np.full(210, 3.0)) is rows


@given(SEEDS)
def test_one_point_follows_the_explicit_formula(seed):
    rows, wanted = constraints(seed, 1)
    basis = rows.toarray()[0]
    explicit = np.outer(basis, wanted[0]) / (basis @ basis)
    np.testing.assert_allclose(moves(rows, wanted), explicit, rtol=1e-13, atol=1e-15)


@given(SEEDS, st.integers(1, 25))
def test_equals_the_pseudo_inverse(seed, count):
    rows, wanted = constraints(seed, count)
    factored = factor(rows)
    if factored.condition < 1e8:
        dense = np.linalg.pinv(rows.toarray()) @ wanted
        scale = np.abs(dense).max()
        np.testing.assert_allclose(rows.T @ factored.multipliers(wanted), dense, atol=1e-9 * scale)


@settings(max_examples=15)
@given(SEEDS, st.integers(2, 8))
def test_no_solution_that_scipy_finds_is_shorter(seed, count):
    rows, wanted = constraints(seed, count)
    factored = factor(rows)
    if factored.condition > 1e6:
        return
    found = (rows.T @ factored.multipliers(wanted))[:, 0]
    reaching = np.unique(rows.indices)
    dense = rows.toarray()[:, reaching]
    start = np.linalg.lstsq(dense, wanted[:, 0], rcond=None)[0]
    start += np.random.default_rng(seed).normal(size=start.shape) * 0.1
    other = scipy.optimize.minimize(
        lambda x: x @ x,
        start,
        jac=lambda x: 2 * x,
        method="SLSQP",
        constraints={
            "type": "eq",
            "fun": lambda x: dense @ x - wanted[:, 0],
            "jac": lambda x: dense,
        },
        options={"ftol": 1e-14, "maxiter": 500},
    )
    if other.success:
        assert found @ found <= other.x @ other.x * (1 + 1e-7)
    # Any other solution differs by something that no source sees, and is longer by its square.
    unseen = np.random.default_rng(seed).normal(size=found.shape)
    unseen -= np.linalg.pinv(rows.toarray()) @ (rows @ unseen)
    assert np.linalg.norm(found + 0.1 * unseen) > np.linalg.norm(found)


@given(SEEDS, st.integers(1, 10))
def test_control_points_that_reach_no_source_do_not_move(seed, count):
    rows, wanted = constraints(seed, count)
    moved = moves(rows, wanted)
    unreached = np.asarray((rows != 0).sum(axis=0) == 0)
    assert unreached.any()
    assert np.all(moved[unreached] == 0)


@given(SEEDS, st.integers(2, 10))
def test_repeated_constraints_that_agree_are_met(seed, count):
    rows, wanted = constraints(seed, count)
    index = np.r_[np.arange(count), 0, count - 1]
    factored = factor(rows[index])
    moved = rows.T @ factor(rows).multipliers(wanted)
    again = rows[index].T @ factored.multipliers(wanted[index])
    assert factored.dependent[[0, count - 1, count, count + 1]].all()
    if factored.condition < 1e6:
        assert factored.dependent.sum() == (3 if count == 1 else 4)
        np.testing.assert_allclose(again, moved, atol=1e-9 * np.abs(moved).max())
        assert np.abs(factored.unreachable(wanted[index])).max() < 1e-12


@given(SEEDS, st.integers(2, 10))
def test_contradictions_are_solved_as_least_squares_of_least_norm(seed, count):
    rows, wanted = constraints(seed, count)
    index = np.r_[np.arange(count), 0]
    wanted = np.vstack([wanted, wanted[0] + 1])
    factored = factor(rows[index])
    if factored.condition > 1e6:
        return
    moved = rows[index].T @ factored.multipliers(wanted)
    dense = rows[index].toarray()
    expected = np.linalg.lstsq(dense, wanted, rcond=1e-9)[0]
    np.testing.assert_allclose(moved, expected, atol=1e-8 * np.abs(expected).max())
    missed = wanted - dense @ moved
    np.testing.assert_allclose(factored.unreachable(wanted), missed, atol=1e-11)
    np.testing.assert_allclose(missed[[0, -1]], [[-0.5] * 3, [0.5] * 3], atol=1e-10)


def test_more_constraints_than_control_points():
    box = volume((3, 3, 3), (2, 2, 2))
    rng = np.random.default_rng(3)
    rows = box.basis_matrix(rng.uniform(size=(200, 3)))
    wanted = rng.normal(size=(200, 3))
    factored = factor(rows)
    assert factored.singular[0].shape == (200, 27)
    expected = np.linalg.lstsq(rows.toarray(), wanted, rcond=None)[0]
    moved = rows.T @ factored.multipliers(wanted)
    np.testing.assert_allclose(moved, expected, atol=1e-9 * np.abs(expected).max())


def test_constraints_out_of_reach_are_left_alone():
    rows, wanted = constraints(1, 3)
    values = np.where(np.arange(rows.nnz) // (rows.nnz // 3) == 1, 0.0, rows.data)
    blind = csr_array((values, rows.indices, rows.indptr), shape=rows.shape)
    factored = factor(blind)
    assert factored.norms[1] == 0
    assert factored.dependent.tolist() == [False, True, False]
    missed = wanted - blind @ (blind.T @ factored.multipliers(wanted))
    np.testing.assert_allclose(missed, wanted * [[0], [1], [0]], atol=1e-13)
    nothing = factor(csr_array(blind.shape))
    assert np.array_equal(nothing.unreachable(wanted), wanted)
    assert not nothing.multipliers(wanted).any()


def test_points_that_may_not_move_are_left_out():
    rows, wanted = constraints(2, 4)
    free = np.random.default_rng(2).uniform(size=rows.shape[1]) < 0.7
    part = free_rows(rows, free)
    moved = moves(part, wanted)
    assert np.all(moved[~free] == 0)
    np.testing.assert_allclose(rows @ moved, wanted, atol=1e-12)
    assert free_rows(rows, np.ones_like(free)) is rows


def test_close_sources_keep_their_accuracy():
    sources = np.array([[0.4, 0.4, 0.4], [0.4 + 1e-5, 0.4, 0.4]])
    rows = volume().basis_matrix(sources)
    wanted = np.array([[0, 0, 0.1], [0, 0, 0.1 + 1e-6]])
    factored = factor(rows)
    assert factored.cholesky is not None
    assert factored.condition > 1e9
    moved = rows.T @ factored.multipliers(wanted)
    np.testing.assert_allclose(rows @ moved, wanted, atol=1e-14)


def test_too_many_dependent_constraints_are_refused(monkeypatch):
    monkeypatch.setattr("ffdcli.lattice.drag.least_norm._MAX_DENSE", 50)
    rows, _ = constraints(1, 2)
    with pytest.raises(TooManyConstraints, match="2 constraints on"):
        factor(rows[[0, 0, 1]][:2])
