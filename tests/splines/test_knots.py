"""Knot vectors: knots, Greville points, blossoms, and restriction to knot boxes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from ffdcli.splines.knots import (
    blossom_weights,
    find_spans,
    greville,
    knot_planes,
    make_knots,
    restriction_weights,
)


@st.composite
def knot_vectors(draw):
    """A degree with knots over [low, high], interior ones repeated up to the degree."""
    degree = draw(st.integers(1, 6))
    raw = draw(st.lists(st.tuples(st.integers(1, 31), st.integers(1, degree)), max_size=4))
    interior = sorted(x / 32 for x, times in dict(raw).items() for _ in range(times))
    low = draw(st.floats(-100, 100))
    high = low + draw(st.floats(0.1, 50))
    clamped = draw(st.booleans())
    count = degree + 1 + len(interior)
    knots = make_knots(degree, count, low, high, interior=np.array(interior), clamped=clamped)
    return degree, count, low, high, knots


@given(knot_vectors())
def test_knots_rise_and_hold_the_ends_exactly(case):
    degree, count, low, high, knots = case
    assert len(knots) == count + degree + 1
    assert np.all(np.diff(knots) >= 0)
    assert knots[degree] == low
    assert knots[count] == high


def test_even_knots():
    clamped = make_knots(2, 6, 0.0, 4.0, interior=None, clamped=True)
    assert clamped.tolist() == [0, 0, 0, 1, 2, 3, 4, 4, 4]
    unclamped = make_knots(2, 6, 0.0, 4.0, interior=None, clamped=False)
    assert unclamped.tolist() == [-2, -1, 0, 1, 2, 3, 4, 5, 6]


@given(knot_vectors(), st.lists(st.floats(0, 1), min_size=1, max_size=9))
def test_greville_points_reproduce_the_line(case, shares):
    degree, _, low, high, knots = case
    values = np.clip(low + np.array(shares) * (high - low), low, high)
    places = greville(knots, degree)
    scale = max(abs(low), abs(high), high - low)
    np.testing.assert_allclose(
        BSpline(knots, places, degree)(values), values, atol=1e-13 * scale, rtol=0
    )


@given(knot_vectors(), st.lists(st.floats(0, 1), min_size=1, max_size=9))
def test_blossom_is_a_partition_of_unity_and_its_diagonal_the_basis(case, shares):
    degree, count, low, high, knots = case
    values = np.clip(low + np.array(shares) * (high - low), low, high)
    spans = find_spans(knots, degree, values)
    assert np.all(knots[spans] < knots[spans + 1])
    assert np.all((knots[spans] <= values) & (values <= knots[spans + 1]))
    arguments = np.repeat(values[:, None], degree, axis=1)
    weights = blossom_weights(knots, degree, spans, arguments)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    full = np.zeros((len(values), count))
    for row, (span, weight) in enumerate(zip(spans, weights, strict=True)):
        full[row, span - degree : span + 1] = weight
    want = BSpline.design_matrix(values, knots, degree).toarray()
    np.testing.assert_allclose(full, want, atol=1e-12)


@given(knot_vectors())
def test_planes_name_interior_knots_with_continuity(case):
    degree, _, low, high, knots = case
    planes = knot_planes(knots, degree)
    assert np.all((planes.values > low) & (planes.values < high))
    for value, continuity in zip(planes.values, planes.continuity, strict=True):
        assert continuity == degree - np.count_nonzero(knots == value)
    assert np.all(planes.continuity >= 0)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_restriction_gives_bezier_points_of_the_piece_continued(degree):
    rng = np.random.default_rng(degree)
    knots = make_knots(degree, degree + 4, 0.0, 1.0, interior=None, clamped=True)
    coefficients = rng.normal(size=degree + 4)
    spans = find_spans(knots, degree, np.array([0.1, 0.4, 0.6, 0.95]))
    low, high = knots[spans] - 0.1, knots[spans + 1] + 0.05
    matrices = restriction_weights(knots, degree, spans, low, high)
    for span, matrix, a, b in zip(spans, matrices, low, high, strict=True):
        bezier = matrix @ coefficients[span - degree : span + 1]
        x = np.linspace(knots[span], knots[span + 1], 5)[1:-1]
        t = (x - a) / (b - a)
        powers = [
            np.prod([(degree - i) / (i + 1) for i in range(j)]) * t**j * (1 - t) ** (degree - j)
            for j in range(degree + 1)
        ]
        want = BSpline(knots, coefficients, degree)(x)
        np.testing.assert_allclose(bezier @ np.array(powers), want, atol=1e-12)
