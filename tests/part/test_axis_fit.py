"""Fits of one direction: what they reproduce, their ends, closed ones, and how they are divided."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.part.axis_fit import Axis, axis_fit, pieces_wanted

OPEN = Axis(3, (0.0, 0.2, 0.5, 1.0), (1, 3))


@pytest.mark.parametrize("density", [3, 4, 6])
def test_splines_of_the_space_are_reproduced(density):
    fit = axis_fit(OPEN, density)
    wanted = np.random.default_rng(0).normal(size=(OPEN.size, 3))
    values = BSpline(OPEN.knots, wanted, 3)(fit.sites)
    assert np.abs(fit.values @ wanted - values).max() <= 1e-14
    assert np.abs(fit.matrix @ values - wanted).max() <= 1e-12


def test_the_ends_are_interpolated():
    fit = axis_fit(OPEN, 3)
    values = np.sin(7 * fit.sites)
    poles = fit.matrix @ values
    assert poles[0] == values[0]
    assert poles[-1] == values[-1]
    assert fit.sites[[0, -1]].tolist() == [0, 1]


def test_a_constant_stays_constant():
    for closed in ("", "continuous", "smooth"):
        axis = Axis(3, (0.0, 0.25, 0.5, 0.75, 1.0), (1, 1, 1), closed)
        fit = axis_fit(axis, 3)
        assert np.abs(fit.matrix.sum(axis=1) - 1).max() <= 1e-12


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_smoothly_closed_fits_close_in_all_derivatives(degree):
    breaks = (0.0, 0.2, 0.3, 0.6, 0.8, 1.0)
    axis = Axis(degree, breaks, (1,) * 4, "smooth")
    fit = axis_fit(axis, degree + 1)
    angles = 2 * np.pi * fit.sites
    values = np.stack([np.cos(angles), np.sin(2 * angles)], axis=1)
    spline = BSpline(axis.knots, fit.matrix @ values, degree)
    for order in range(degree):
        first, last = spline(np.array([0.0, 1.0]), order)
        scale = np.abs(spline(np.linspace(0, 1, 50), order)).max()
        assert np.abs(first - last).max() <= 1e-11 * scale
    assert np.abs(spline(fit.sites) - values).max() < 0.5


def test_errors_fall_with_the_fourth_power():
    found = []
    for count in (8, 16, 32):
        axis = Axis(3, (0.0, 1.0), ()).split(np.array([count]))
        fit = axis_fit(axis, 3)
        spline = BSpline(axis.knots, fit.matrix @ np.exp(fit.sites), 3)
        at = np.linspace(0, 1, 997)
        found.append(np.abs(spline(at) - np.exp(at)).max())
    assert np.allclose(np.array(found[:-1]) / found[1:], 16, rtol=0.25)


def test_intervals_are_divided_by_single_knots():
    axis = OPEN.split(np.array([1, 3, 2]))
    assert np.allclose(axis.breaks, [0, 0.2, 0.3, 0.4, 0.5, 0.75, 1])
    assert axis.mults == (1, 1, 1, 3, 1)
    assert axis.size == OPEN.size + 3


def test_pieces_follow_from_the_order():
    errors = np.array([0.5, 1.0, 1.5, 16.0, 81.0, 1e9])
    assert pieces_wanted(errors, 1.0, 3, 4).tolist() == [1, 1, 2, 2, 3, 4]
