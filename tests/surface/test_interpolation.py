"""The constant matrices of interpolation, against exact arithmetic and numpy's polynomials."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from ffdcli.surface.interpolation import interpolate, inverse_matrix, lebesgue, uniform_matrix


def exact_matrix(degree: int) -> list[list[Fraction]]:
    share = [Fraction(i, degree) for i in range(degree + 1)]
    return [
        [comb(degree, j) * t**j * (1 - t) ** (degree - j) for j in range(degree + 1)] for t in share
    ]


@pytest.mark.parametrize("degree", range(1, 13))
def test_the_inverse_is_that_of_exact_arithmetic_correctly_rounded(degree: int) -> None:
    """Points of a Bernstein form from its values: B^-1 = (elevated powers) (Vandermonde)^-1.

    The oracle inverts through Lagrange polynomials in powers of t, all in fractions.
    """
    size = degree + 1
    places = [Fraction(i, degree) for i in range(size)]
    expected = np.zeros((size, size))
    for column in range(size):
        # Coefficients of the Lagrange polynomial that is 1 at this place, by rising powers.
        powers = [Fraction(1)]
        for other in range(size):
            if other != column:
                scale = places[column] - places[other]
                shifted = [Fraction(0), *powers]
                powers = [
                    (a - places[other] * b) / scale
                    for a, b in zip(shifted, [*powers, Fraction(0)], strict=True)
                ]
        for row in range(size):
            value = sum(Fraction(comb(row, i), comb(degree, i)) * powers[i] for i in range(row + 1))
            expected[row, column] = float(value)
    assert np.array_equal(inverse_matrix(degree), expected)
    assert np.array_equal(
        uniform_matrix(degree), [[float(x) for x in row] for row in exact_matrix(degree)]
    )
    assert inverse_matrix(degree) is inverse_matrix(degree)


@pytest.mark.parametrize(("s", "t"), [(2, 2), (6, 9), (8, 8), (8, 12), (13, 19)])
def test_surfaces_keep_more_digits_than_control_points(s: int, t: int) -> None:
    """On the rectangle: within 64 ulp times the Lebesgue constants, as edges' tolerances state."""
    rng = np.random.default_rng(s * 20 + t)
    points = rng.uniform(-1, 1, (20, s + 1, t + 1, 3))

    def values(share_s: np.ndarray, share_t: np.ndarray, form: np.ndarray) -> np.ndarray:
        along = [
            np.array([[comb(n, i) * x**i * (1 - x) ** (n - i) for i in range(n + 1)] for x in at])
            for n, at in ((s, share_s), (t, share_t))
        ]
        return np.einsum("ai,bj,mijd->mabd", *along, form)

    found = interpolate(values(np.arange(s + 1) / s, np.arange(t + 1) / t, points))
    fine = np.linspace(0, 1, 33)
    error = np.abs(values(fine, fine, found - points)).max()
    assert error <= 64 * np.finfo(float).eps * lebesgue(s) * lebesgue(t)
    assert np.abs(found - points).max() >= error


def test_lebesgue_constants_are_the_known_ones() -> None:
    known = {1: 1, 2: 1.25, 3: 1.6311, 4: 2.2078, 5: 3.1063, 10: 29.8907}
    for degree, value in known.items():
        assert lebesgue(degree) == pytest.approx(value, rel=2e-3)
