"""Drags with rigid pieces: optimal, exact, and as close as can be where wishes contradict."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from ffdcli.lattice.drag.least_norm import factor, free_rows
from ffdcli.lattice.drag.rigid import NotConverged, make_piece, solve_motions


def piece_of(rows, points, members):
    return make_piece(rows, members, points[members], np.ones(len(members), dtype=bool))


def problem(seed, constraints, pieces=1, free=True):
    """Random basis rows over 60 control points, the first 12 (and the next 12) rigid."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(size=(constraints, 60)) ** 4
    if not free:
        rows[:, 12 * pieces :] = 0
    rows /= rows.sum(axis=1, keepdims=True)
    points = rng.normal(size=(60, 3))
    sparse = csr_array(rows)
    members = [np.arange(12 * i, 12 * i + 12) for i in range(pieces)]
    loose = np.ones(60, dtype=bool)
    loose[: 12 * pieces] = False
    factored = factor(free_rows(sparse, loose))
    return sparse, points, factored, [piece_of(sparse, points, each) for each in members], rng


def displacements(points, factored, pieces, motions, left_over):
    out = factored.rows.T @ factored.multipliers(left_over)
    for piece, motion in zip(pieces, motions, strict=True):
        out[piece.members] += motion.displace(piece.arms, piece.carried)
    return out


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 2))
def test_targets_are_met_and_nothing_shorter_is_near(seed, constraints, pieces):
    rows, points, factored, parts, rng = problem(seed, constraints, pieces)
    wanted = rng.normal(size=(constraints, 3))
    motions, left_over = solve_motions(factored, parts, wanted)
    moved = displacements(points, factored, parts, motions, left_over)
    np.testing.assert_allclose(rows @ moved, wanted, atol=1e-11)
    for motion in motions:
        np.testing.assert_allclose(motion.rotation @ motion.rotation.T, np.eye(3), atol=1e-14)

    def cost(steps):
        changed = [
            type(m)(Rotation.from_rotvec(s[:3]).as_matrix() @ m.rotation, m.shift + s[3:])
            for m, s in zip(motions, steps.reshape(-1, 6), strict=True)
        ]
        rest = wanted.copy()
        for piece, motion in zip(parts, changed, strict=True):
            rest -= motion.displace(piece.levers, piece.shares)
        return (displacements(points, factored, parts, changed, rest) ** 2).sum()

    best = cost(np.zeros(6 * pieces))
    slope = scipy.optimize.approx_fprime(np.zeros(6 * pieces), cost, 1e-6)
    assert np.abs(slope).max() < 1e-3 * (1 + best)
    for _ in range(10):
        assert cost(0.03 * rng.normal(size=6 * pieces)) >= best * (1 - 1e-12)


@given(st.integers(0, 2**32 - 1))
def test_a_rigid_wish_is_met_by_the_rigid_motion(seed):
    rows, points, factored, parts, rng = problem(seed, 5, free=False)
    turn = Rotation.from_rotvec(rng.uniform(-0.9, 0.9, 3)).as_matrix()
    shift = rng.normal(size=3)
    wanted = rows @ (points @ turn.T + shift - points)
    (motion,), left_over = solve_motions(factored, parts, wanted)
    assert np.abs(left_over).max() < 1e-11
    assert np.abs(motion.rotation - turn).max() < 1e-9


def test_contradicting_wishes_are_missed_least():
    _, _, factored, parts, rng = problem(5, 4, free=False)
    wanted = 0.3 * rng.normal(size=(4, 3))
    _, left_over = solve_motions(factored, parts, wanted)

    def missed(step):
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        arms = parts[0].levers
        shift = np.multiply.outer(parts[0].shares, step[3:])
        return (wanted - (arms @ turn.T - arms + shift)).ravel()

    best = scipy.optimize.least_squares(missed, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert (left_over**2).sum() == pytest.approx(2 * best.cost, rel=1e-8)


def test_giving_up_is_an_error(monkeypatch):
    monkeypatch.setattr("ffdcli.lattice.drag.rigid._MOST_STEPS", 1)
    _, _, factored, parts, rng = problem(1, 3)
    with pytest.raises(NotConverged):
        solve_motions(factored, parts, rng.normal(size=(3, 3)))
