"""Composition of tensor-product forms with planes, against polynomial arithmetic."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import polynomial as poly

from ffdcli.splines.composition import compose_plane, in_parts, merge_variables

degrees = st.integers(1, 4)
seeds = st.integers(0, 2**32 - 1)


def to_power(bernstein: np.ndarray) -> list[Fraction]:
    """Exact power coefficients of a univariate Bernstein form."""
    n = len(bernstein) - 1
    out = [Fraction(0)] * (n + 1)
    for i, value in enumerate(bernstein):
        for j in range(n - i + 1):
            sign = -1 if j % 2 else 1
            out[i + j] += sign * comb(n, i) * comb(n - i, j) * Fraction(float(value))
    return out


def from_power(power: list[Fraction]) -> list[Fraction]:
    n = len(power) - 1
    return [
        sum((Fraction(comb(i, j), comb(n, j)) * power[j] for j in range(i + 1)), Fraction(0))
        for i in range(n + 1)
    ]


def multiply(p: list[Fraction], q: list[Fraction]) -> list[Fraction]:
    out = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            out[i + j] += x * y
    return out


def bernstein_row(n: int, t: np.ndarray) -> np.ndarray:
    return np.stack([comb(n, i) * t**i * (1 - t) ** (n - i) for i in range(n + 1)], axis=-1)


@settings(max_examples=30)
@given(degrees, degrees, seeds)
def test_merged_variables_are_the_diagonal_exactly(p: int, q: int, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-1, 1, (1, p + 1, q + 1, 1))
    merged = merge_variables(points, 1, 2)
    assert merged.shape == (1, p + q + 1, 1)
    # sum_i B_i^p(t) * (sum_j P_ij B_j^q(t)), multiplied out in powers of t
    total = [Fraction(0)] * (p + q + 1)
    for i in range(p + 1):
        first = to_power(np.eye(p + 1)[i])
        for power, value in enumerate(multiply(first, to_power(points[0, i, :, 0]))):
            total[power] += value
    exact = from_power(total)
    assert max(abs(Fraction(float(x)) - y) for x, y in zip(merged[0, :, 0], exact, strict=True)) < (
        Fraction(1, 10**15)
    )


def test_merging_keeps_other_axes_in_place() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(2, 3, 4, 5, 3))
    merged = merge_variables(points, 2, 3)
    assert merged.shape == (2, 3, 8, 3)
    t = rng.random(6)
    direct = np.einsum("mabcd,tb,tc->matd", points, bernstein_row(3, t), bernstein_row(4, t))
    through = np.einsum("mabd,tb->matd", merged, bernstein_row(7, t))
    np.testing.assert_allclose(through, direct, atol=1e-14)


@settings(max_examples=30)
@given(degrees, degrees, degrees, seeds)
def test_composition_with_a_plane(ka: int, kb: int, kc: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (3, ka + 1, kb + 1, kc + 1, 2))
    base, lean = rng.uniform(0.3, 0.7, (3, 1)), rng.uniform(-0.15, 0.15, (3, 2))
    share = base[:, :, None] + (
        lean[:, :1, None] * np.array([-1, 1])[:, None] + lean[:, 1:, None] * np.array([-1, 1])
    )
    composed = compose_plane(points, share)
    assert composed.shape == (3, kb + ka + 1, kc + ka + 1, 2)
    s, t = rng.random(8), rng.random(8)
    r = base + lean[:, :1] * (2 * s - 1) + lean[:, 1:] * (2 * t - 1)
    row_s, row_t = bernstein_row(kb, s), bernstein_row(kc, t)
    direct = np.einsum("mabcd,mpa,pb,pc->mpd", points, bernstein_row(ka, r), row_s, row_t)
    through = np.einsum(
        "mbcd,pb,pc->mpd", composed, bernstein_row(kb + ka, s), bernstein_row(kc + ka, t)
    )
    np.testing.assert_allclose(through, direct, atol=2e-14)


def test_composition_against_polynomial_arithmetic() -> None:
    """Coefficients in powers of s and t, multiplied by numpy.polynomial's own convolution."""
    rng = np.random.default_rng(5)
    ka, kb, kc = 3, 2, 2
    points = rng.uniform(-1, 1, (1, ka + 1, kb + 1, kc + 1, 1))
    share = np.array([[[0.1, 0.3], [0.6, 0.8]]])  # r = 0.1 + 0.5 s + 0.2 t
    composed = compose_plane(points, share)[0, :, :, 0]
    s = rng.random(5)
    for t in rng.random(5):
        r = [0.1 + 0.2 * t, 0.5]
        total = np.zeros(ka + kb + 1)
        for i in range(ka + 1):
            piece = bernstein_row(kc, np.array([t]))[0] @ points[0, i, :, :, 0].T
            power = np.array([float(x) for x in to_power(piece)])
            plane = comb(ka, i) * poly.polymul(
                poly.polypow(r, i), poly.polypow(poly.polysub([1], r), ka - i)
            )
            product = poly.polymul(power, plane)
            total[: len(product)] += product
        row = bernstein_row(composed.shape[1] - 1, np.array([t]))[0]
        through = bernstein_row(composed.shape[0] - 1, s) @ composed @ row
        np.testing.assert_allclose(through, poly.polyval(s, total), atol=1e-14)


@pytest.mark.parametrize(("count", "cells"), [(1, 5000), (3, 5000), (3000, 1), (700, 7)])
def test_parts_hold_every_item_once_and_none_is_empty(count, cells):
    parts = in_parts(np.arange(count), cells)
    assert all(len(part) for part in parts)
    assert np.array_equal(np.concatenate(parts), np.arange(count))
    assert all(len(part) == 1 or len(part) * cells <= 1024 for part in parts)
