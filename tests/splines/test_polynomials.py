"""Bernstein arithmetic against exact fractions and plain evaluation."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from ffdcli.splines.polynomials import (
    add_product,
    binomials,
    derivative,
    halve,
    raise_degree,
    scale,
    unscale,
    values_at,
)


def test_binomials():
    assert binomials(7).tolist() == [comb(7, i) for i in range(8)]
    with pytest.raises(ValueError, match="read-only"):
        binomials(7)[0] = 2


def exact(form, point):
    """Value of one form (n_1 + 1, ..., n_d + 1) at a point, in fractions."""
    total = Fraction(0)
    for index in np.ndindex(form.shape):
        term = Fraction(float(form[index]))
        for i, count, t in zip(index, form.shape, point, strict=True):
            x, n = Fraction(float(t)), count - 1
            term *= comb(n, i) * x**i * (1 - x) ** (n - i)
        total += term
    return total


def test_values_products_and_raised_forms_are_right():
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(4, 1, 3, 5)), rng.normal(size=(2, 3, 3, 5))
    points = rng.uniform(size=(5, 3))
    product = np.zeros((5, 3, 5, 5))
    add_product(product, scale(left), scale(right), -1)
    product = unscale(product)
    raised = unscale(raise_degree(scale(left), 1))
    assert raised.shape == (4, 2, 3, 5)
    for box, point in enumerate(points):
        a, b = exact(left[..., box], point), exact(right[..., box], point)
        assert values_at(left, points)[box] == pytest.approx(float(a), abs=1e-14)
        assert float(exact(product[..., box], point)) == pytest.approx(float(-a * b), abs=1e-14)
        assert float(exact(raised[..., box], point)) == pytest.approx(float(a), abs=1e-14)


def test_halves_and_derivatives():
    rng = np.random.default_rng(1)
    forms, points = rng.normal(size=(4, 3, 2, 6)), rng.uniform(size=(6, 3))
    for axis in range(3):
        lower, upper = halve(forms, axis)
        for half, start in ((lower, 0.0), (upper, 0.5)):
            inside = points.copy()
            inside[:, axis] = start + points[:, axis] / 2
            np.testing.assert_allclose(
                values_at(half, points), values_at(forms, inside), atol=1e-14
            )
        step = 1e-6 * np.eye(3)[axis]
        slope = (values_at(forms, points + step) - values_at(forms, points - step)) / 2e-6
        np.testing.assert_allclose(values_at(derivative(forms, axis), points), slope, atol=1e-8)
