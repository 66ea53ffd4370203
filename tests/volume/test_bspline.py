"""B-spline and NURBS volumes: identity at rest, derivatives, Bézier form of knot boxes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffdcli.splines.knots import make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame, aligned_frame

BOX = np.array([[-1.0, 2.0, 0.5], [3.0, 2.5, 6.5]])


def volume(degrees=(3, 2, 1), counts=(6, 4, 5), clamped=True, seed=None):
    knots = tuple(
        make_knots(k, n, BOX[0, a], BOX[1, a], interior=None, clamped=clamped)
        for a, (k, n) in enumerate(zip(degrees, counts, strict=True))
    )
    at_rest = BSplineVolume(degrees, knots, np.zeros((*counts, 3)), Frame(np.zeros(3), np.eye(3)))
    at_rest = at_rest.with_net(at_rest.rest_points)
    if seed is None:
        return at_rest
    rng = np.random.default_rng(seed)
    return at_rest.with_net(at_rest.net + 0.1 * rng.normal(size=at_rest.net.shape))


def inner_points(count=50, seed=0):
    return np.random.default_rng(seed).uniform(BOX[0], BOX[1], size=(count, 3))


cases = st.tuples(*[st.tuples(st.integers(1, 5), st.integers(1, 4))] * 3, st.booleans()).map(
    lambda c: (tuple(k for k, _ in c[:3]), tuple(k + m for k, m in c[:3]), c[3])
)


@given(cases)
def test_at_rest_it_is_the_identity(case):
    degrees, counts, clamped = case
    rest, points = volume(degrees, counts, clamped), inner_points()
    corners = np.stack(np.meshgrid(*BOX.T, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([points, corners])
    np.testing.assert_allclose(rest.evaluate(points), points, atol=2e-14)
    np.testing.assert_allclose(
        rest.jacobian(points), np.broadcast_to(np.eye(3), (58, 3, 3)), atol=1e-12
    )


@given(cases, st.integers(0, 2**32 - 1))
def test_affine_nets_give_affine_maps(case, seed):
    degrees, counts, clamped = case
    rng = np.random.default_rng(seed)
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    rest, points = volume(degrees, counts, clamped), inner_points()
    bent = rest.with_net(rest.net @ matrix.T + shift)
    np.testing.assert_allclose(bent.evaluate(points), points @ matrix.T + shift, atol=1e-13)
    np.testing.assert_allclose(
        bent.jacobian(points), np.broadcast_to(matrix, (50, 3, 3)), atol=1e-11
    )


@given(cases)
def test_basis_is_a_partition_of_unity_and_evaluates(case):
    degrees, counts, clamped = case
    bent, points = volume(degrees, counts, clamped, seed=1), inner_points()
    matrix = bent.basis_matrix(points)
    assert matrix.shape == (50, np.prod(counts))
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-13)
    assert matrix.data.min() >= 0
    np.testing.assert_allclose(matrix @ bent.net.reshape(-1, 3), bent.evaluate(points), atol=1e-13)


def test_outside_the_box_nothing_moves_and_the_box_is_inside():
    bent = volume(seed=2)
    outside = np.array([[-1 - 1e-15 * 4, 2.2, 3], [5, 5, 5], [0, 2.2, 6.5 + 1e-14]])
    assert np.array_equal(bent.evaluate(outside), outside)
    assert np.array_equal(bent.jacobian(outside), np.broadcast_to(np.eye(3), (3, 3, 3)))
    assert np.array_equal(bent.contains(outside), [False] * 3)
    assert bent.contains(BOX).all()
    np.testing.assert_allclose(bent.evaluate(BOX), bent.net[[0, -1], [0, -1], [0, -1]], atol=1e-14)


def test_jacobian_is_the_derivative():
    bent, points, step = volume(seed=3), inner_points(), 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = (bent.evaluate(points + shift) - bent.evaluate(points - shift)) / (2 * step)
        smooth = np.abs((bent.evaluate(points + shift) - bent.evaluate(points)) / step - slope)
        kept = smooth.max(axis=1) < 1e-4  # not astride a knot plane of the degree 1 axis
        assert kept.sum() > 40
        np.testing.assert_allclose(bent.jacobian(points)[kept, :, axis], slope[kept], atol=1e-7)


def test_equal_weights_change_nothing_and_others_divide():
    bent, points = volume(seed=4), inner_points()
    weighted = np.concatenate([2 * bent.net, np.full((*bent.shape, 1), 2.0)], axis=-1)
    rational = bent.with_net(weighted)
    np.testing.assert_allclose(rational.evaluate(points), bent.evaluate(points), atol=1e-14)
    np.testing.assert_allclose(rational.jacobian(points), bent.jacobian(points), atol=1e-12)


@pytest.mark.parametrize("clamped", [True, False])
def test_restriction_reproduces_the_cell(clamped):
    bent, points = volume(clamped=clamped, seed=5), inner_points(7)
    cells = bent.cells(points)
    bounds = bent.cell_bounds(cells)
    assert np.all((bounds[:, 0] <= points) & (points <= bounds[:, 1]))
    low, high = bounds[:, 0] - 0.3, bounds[:, 1] + 0.2
    restriction = bent.restrict(cells, low, high)
    bezier = restriction.apply(bent.net)
    first = bent.at_points(cells, low).apply(bent.net)
    np.testing.assert_allclose(first, bezier[:, :1, :1, :1], atol=1e-14)
    share = (points - low) / (high - low)
    for axis, degree in enumerate(bent.degrees):
        for _ in range(degree):  # de Casteljau along each axis in turn
            t = share[:, axis].reshape(-1, 1, 1, 1, 1)
            bezier = np.moveaxis(bezier, axis + 1, 1)
            bezier = (1 - t) * bezier[:, :-1] + t * bezier[:, 1:]
            bezier = np.moveaxis(bezier, 1, axis + 1)
    np.testing.assert_allclose(bezier[:, 0, 0, 0], bent.evaluate(points), atol=1e-12)


def test_far_frames_cost_no_digit():
    low = np.array([1e7 + 0.1, -3.3, 2e5])
    high = low + np.array([1.7, 0.4, 1.1])
    frame = aligned_frame(low, high)
    assert frame.aligned
    assert frame.origin[1] == 0
    points = np.random.default_rng(0).uniform(low - 1, high + 1, size=(1000, 3))
    assert np.array_equal(frame.to_model(frame.to_local(points)), points)
    assert np.abs(frame.to_local(points)).max() < 16


def test_turned_frames_go_there_and_back():
    axes = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]])
    frame = Frame(np.array([1.0, 2.0, 3.0]), axes)
    assert not frame.aligned
    np.testing.assert_allclose(frame.to_local(np.array([1.6, 2.8, 3.0])), [1, 0, 0], atol=1e-15)
    points = inner_points()
    np.testing.assert_allclose(frame.to_model(frame.to_local(points)), points, atol=1e-14)
    np.testing.assert_allclose(
        frame.turn_to_model(points), frame.to_model(points) - frame.origin, atol=1e-14
    )
