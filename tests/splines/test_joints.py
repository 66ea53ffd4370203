"""Bézier pieces joined into one B-spline, against the spline they were cut from."""

from __future__ import annotations

from itertools import pairwise
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from ffdcli.splines.joints import plan_joint

seeds = st.integers(0, 2**32 - 1)


def bernstein_row(n: int, t: np.ndarray) -> np.ndarray:
    return np.stack([comb(n, i) * t**i * (1 - t) ** (n - i) for i in range(n + 1)], axis=-1)


@st.composite
def splines(draw: st.DrawFn) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    degree = draw(st.integers(1, 8))
    mults = np.array(draw(st.lists(st.integers(1, degree), max_size=6)), dtype=np.int64)
    rng = np.random.default_rng(draw(seeds))
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1, len(mults) + 1))])
    poles = rng.uniform(-1, 1, (degree + 1 + int(mults.sum()), 2))
    return degree, breaks, mults, poles


@settings(max_examples=60)
@given(splines())
def test_joined_pieces_give_back_the_spline(
    case: tuple[int, np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Pieces cut from a spline with given multiplicities join to its own control points."""
    degree, breaks, mults, poles = case
    knots = np.repeat(breaks, np.concatenate([[degree + 1], mults, [degree + 1]]))
    spline = BSpline(knots, poles, degree)
    sites = (np.arange(degree + 1) + 0.5) / (degree + 1)
    matrix = bernstein_row(degree, sites)
    pieces = np.stack(
        [
            np.linalg.solve(matrix, spline(low + sites * (high - low)))
            for low, high in pairwise(breaks)
        ]
    )
    joint = plan_joint(breaks[None], mults, degree)
    joined = joint.apply(pieces[None], np.array([0]))[0]
    assert joined.shape == poles.shape
    np.testing.assert_allclose(joined, poles, atol=1e-10)
    middles = np.concatenate([low + sites * (high - low) for low, high in pairwise(breaks)])
    again = BSpline(knots, joined, degree)
    np.testing.assert_allclose(again(middles), spline(middles), atol=1e-10)


def test_joined_pieces_have_the_continuity_of_their_multiplicities() -> None:
    """Two truncated powers: C^(degree - m) and no more is kept by multiplicity m."""
    degree = 5
    for mult in range(1, degree + 1):
        order = degree - mult + 1  # the first derivative that may jump
        breaks = np.array([0.0, 0.5, 1.0])
        # left: 0, right: (x - 1/2)^order in Bernstein form on [1/2, 1]
        right = np.array([comb(i, order) / comb(degree, order) for i in range(degree + 1)])
        right /= 2**order
        pieces = np.stack([np.zeros(degree + 1), right])[None, :, :, None]
        joint = plan_joint(breaks[None], np.array([mult]), degree)
        joined = joint.apply(pieces, np.array([0]))[0, :, 0]
        knots = np.repeat(breaks, [degree + 1, mult, degree + 1])
        spline = BSpline(knots, joined, degree)
        x = np.linspace(0, 1, 41)
        np.testing.assert_allclose(spline(x), np.maximum(x - 0.5, 0) ** order, atol=1e-15)
        assert spline(0.5 - 1e-12, nu=order) == pytest.approx(0, abs=1e-9)
        jump = spline(0.5, nu=order) - spline(0.5 - 1e-12, nu=order)
        assert abs(jump) > 0.5


def test_one_piece_is_its_own_spline_and_chosen_ones_are_told_apart() -> None:
    rng = np.random.default_rng(3)
    breaks = np.array([[0.0, 1.0], [2.0, 5.0], [-1.0, 0.5]])
    alone = rng.normal(size=(3, 1, 4, 2))
    single = plan_joint(breaks, np.array([], dtype=np.int64), 3)
    np.testing.assert_array_equal(single.apply(alone, np.arange(3)), alone[:, 0])

    breaks = np.sort(rng.random((5, 4)), axis=1)
    pieces = rng.normal(size=(5, 3, 4, 2))
    joint = plan_joint(breaks, np.array([1, 3]), 3)
    every = joint.apply(pieces, np.arange(5))
    assert every.shape == (5, 4 + 1 + 3, 2)
    some = np.array([4, 1])
    np.testing.assert_array_equal(joint.apply(pieces[some], some), every[some])
    np.testing.assert_array_equal(joint.take(some).apply(pieces[some], np.arange(2)), every[some])
    np.testing.assert_allclose(joint.weights.sum(axis=2), 1, atol=1e-12)
