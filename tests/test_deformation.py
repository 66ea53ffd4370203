"""The deformation of a whole model: which points count as lying in a lattice box."""

from types import SimpleNamespace

import numpy as np

from ffdcli.deformation import Deformation
from ffdcli.splines.knots import make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame


def stretched():
    """The unit box, twice as long along u."""
    knots = make_knots(1, 2, 0.0, 1.0, interior=None, clamped=True)
    frame = Frame(np.zeros(3), np.eye(3))
    volume = BSplineVolume((1, 1, 1), (knots,) * 3, np.zeros((2, 2, 2, 3)), frame)
    return volume.with_net(volume.rest_points * [2.0, 1.0, 1.0])


def test_noise_is_let_in_where_the_mesh_ends_and_not_where_it_goes_on():
    volume = stretched()
    member = SimpleNamespace(crossed=("u_max", "w_min"))
    lattice = SimpleNamespace(maps=(volume,), members=(member,))
    deformation = Deformation.of(lattice, 1e-3)
    assert deformation.slack.tolist() == [[[0.016, 0.016, 0], [0, 0.016, 0.016]]]
    below, above = np.array([[-0.01, 0.5, 0.5]]), np.array([[1.01, 0.5, 0.5]])
    # Beyond the lower side the map goes on, beyond the upper one points stay.
    np.testing.assert_allclose(deformation.images(below), [[-0.02, 0.5, 0.5]], atol=1e-15)
    assert np.array_equal(deformation.images(above), above)
    np.testing.assert_allclose(deformation.jacobian(below)[0], np.diag([2.0, 1, 1]), atol=1e-15)
    assert np.array_equal(deformation.jacobian(above)[0], np.eye(3))
    on = np.array([[1.0, 0.5, 0.0]])
    np.testing.assert_allclose(deformation.images(on), [[2.0, 0.5, 0.0]], atol=1e-15)


def test_a_volume_alone_is_continued_everywhere():
    volume = stretched()
    beyond = np.array([[3.0, 0.5, -2.0]])
    both = Deformation((volume, volume), np.zeros((2, 2, 3)))
    assert np.array_equal(both.images(beyond), beyond)
    for alone in both.alone:
        np.testing.assert_allclose(alone.images(beyond), [[6.0, 0.5, -2.0]])


def test_the_identity_moves_nothing():
    points = np.array([[1.0, 2.0, 3.0]])
    assert np.array_equal(Deformation.identity().images(points), points)
    assert np.array_equal(Deformation.identity().jacobian(points), np.eye(3)[None])
