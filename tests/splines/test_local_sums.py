"""Sums written out: against scipy's basis functions."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.splines.knots import make_knots
from ffdcli.splines.local_sums import collect_sums
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame

DEGREES, COUNTS = (3, 1, 2), (7, 4, 5)


@pytest.fixture
def volume():
    knots = tuple(
        make_knots(k, n, -1.0, 2.0, interior=None, clamped=True)
        for k, n in zip(DEGREES, COUNTS, strict=True)
    )
    net = np.random.default_rng(1).normal(size=(*COUNTS, 3))
    return BSplineVolume(DEGREES, knots, net, Frame(np.zeros(3), np.eye(3)))


def design(volume, points, along):
    """(m, n) basis functions, differentiated along one axis, by scipy."""
    rows = []
    for axis, (t, k, n) in enumerate(zip(volume.knots, DEGREES, COUNTS, strict=True)):
        functions = BSpline(t, np.eye(n), k)
        rows.append(functions(points[:, axis], nu=int(axis == along)))
    return np.einsum("mi,mj,mk->mijk", *rows).reshape(len(points), -1)


def test_slopes_are_the_derivatives(volume):
    points = np.random.default_rng(2).uniform(-1, 2, (200, 3))
    found = volume.slope_sums(points).apply(volume.net).reshape(200, 3, 3)
    for along in range(3):
        expected = design(volume, points, along) @ volume.net.reshape(-1, 3)
        np.testing.assert_allclose(found[:, along], expected, atol=2e-14)
    np.testing.assert_allclose(found.transpose(0, 2, 1), volume.jacobian(points), atol=1e-13)


def test_no_points_no_slopes(volume):
    sums = volume.slope_sums(np.empty((0, 3)))
    assert sums.apply(volume.net).shape == (0, 3)
    assert sums.bytes == 0


def test_rows_come_back_in_their_order_whatever_box_they_reach(volume):
    """More rows of one box than are multiplied at once, the boxes all mixed up."""
    rng = np.random.default_rng(3)
    first = rng.integers(0, (4, 3, 3), (40, 3))
    box = rng.integers(0, 40, 5000)
    weights = rng.normal(size=(5000, 4 * 2 * 3))
    parts = np.array_split(rng.permutation(5000), 7)
    sums = collect_sums(DEGREES, first, box, ((part, weights[part]) for part in parts))
    assert np.diff(sums.starts).max() > 0
    found = sums.apply(volume.net)
    for i in rng.integers(0, 5000, 300):
        u, v, w = first[box[i]]
        local = volume.net[u : u + 4, v : v + 2, w : w + 3].reshape(-1, 3)
        np.testing.assert_allclose(found[i], weights[i] @ local, atol=1e-14)
    alone = collect_sums(DEGREES, np.array([[1, 2, 0]]), np.zeros(3000, dtype=np.int64), [
        (np.arange(3000), weights[:3000])
    ])  # fmt: skip
    local = volume.net[1:5, 2:4, 0:3].reshape(-1, 3)
    np.testing.assert_allclose(alone.apply(volume.net), weights[:3000] @ local, atol=1e-13)
    assert alone.bytes == 3000 * (24 + 1) * 8
