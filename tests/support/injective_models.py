"""Random volumes, and an oracle for det J that shares no code with the program."""

from itertools import product

import numpy as np
from hypothesis import strategies as st
from scipy.interpolate import NdBSpline

from ffdcli.splines.knots import make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame
from ffdcli.volume.weights import homogeneous

LOW, HIGH = np.array([-1.0, 2.0, 0.5]), np.array([1.5, 4.0, 3.0])


def at_rest(degrees, counts, *, interior=None, clamped=True, low=LOW, high=HIGH):
    """The identity over a box."""
    inner = interior or (None,) * 3
    knots = tuple(
        make_knots(k, n, a, b, interior=f, clamped=clamped)
        for k, n, a, b, f in zip(degrees, counts, low, high, inner, strict=True)
    )
    volume = BSplineVolume(degrees, knots, np.zeros((*counts, 3)), Frame(np.zeros(3), np.eye(3)))
    return volume.with_net(volume.rest_points)


def shaken(degrees, counts, amount, seed, *, clamped=True, heavy=1.0):
    """Control points moved at random by ``amount`` of a cell; weights from 1 to ``heavy``."""
    rng = np.random.default_rng(seed)
    interior = tuple(
        np.sort(rng.uniform(0.1, 0.9, n - k - 1)) for k, n in zip(degrees, counts, strict=True)
    )
    volume = at_rest(degrees, counts, interior=interior, clamped=clamped)
    reach = amount * (HIGH - LOW) / np.array(counts)
    points = volume.net + reach * rng.uniform(-1, 1, volume.net.shape)
    return volume.with_net(homogeneous(points, heavy ** rng.uniform(0, 1, counts)))


@st.composite
def volumes(draw, heavy=1.0):
    """Shaken volumes of all degrees and ends: some folded, most not."""
    degrees = tuple(draw(st.integers(1, 3)) for _ in range(3))
    counts = tuple(k + draw(st.integers(1, 3)) for k in degrees)
    amount, seed = draw(st.floats(0, 0.6)), draw(st.integers(0, 2**32 - 1))
    return shaken(degrees, counts, amount, seed, clamped=draw(st.booleans()), heavy=heavy)


def oracle(volume, points):
    """det J by scipy's own tensor-product splines, quotient rule in the open."""
    spline = NdBSpline(volume.knots, volume.net, volume.degrees)
    value = spline(points)
    slopes = np.stack([spline(points, nu=nu) for nu in np.eye(3, dtype=int)], axis=-1)
    if value.shape[1] == 4:
        weight = value[:, 3]
        slopes = slopes[:, :3] - (value[:, :3] / weight[:, None])[:, :, None] * slopes[:, 3:]
        slopes = slopes / weight[:, None, None]
    return np.linalg.det(slopes)


def grid(volume, count=4000, seed=0):
    """Random points of the box, and points of its sides, edges and corners."""
    low, high = volume.box
    shares = np.random.default_rng(seed).uniform(size=(count, 3))
    shares[: count // 2] = np.where(shares[: count // 2] < 0.3, 0.0, shares[: count // 2])
    shares[: count // 3] = np.where(shares[: count // 3] > 0.7, 1.0, shares[: count // 3])
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    return low + np.concatenate([shares, corners]) * (high - low)
