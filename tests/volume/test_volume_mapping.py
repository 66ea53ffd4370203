"""Which points count as lying in the box of a lattice."""

import numpy as np

from ffdcli.splines.knots import make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame
from ffdcli.volume.mapping import deformation, derivatives, side_slack


def stretched():
    """The unit box, twice as long along u."""
    knots = make_knots(1, 2, 0.0, 1.0, interior=None, clamped=True)
    frame = Frame(np.zeros(3), np.eye(3))
    volume = BSplineVolume((1, 1, 1), (knots,) * 3, np.zeros((2, 2, 2, 3)), frame)
    return volume.with_net(volume.rest_points * [2.0, 1.0, 1.0])


def test_noise_is_let_in_where_the_mesh_ends_and_not_where_it_goes_on():
    volume, delta = stretched(), 1e-3
    (slack,) = side_slack([("u_max", "w_min")], delta)
    assert slack.tolist() == [[0.016, 0.016, 0], [0, 0.016, 0.016]]
    below, above = np.array([[-0.01, 0.5, 0.5]]), np.array([[1.01, 0.5, 0.5]])
    deform, jacobian = deformation([volume], [slack]), derivatives([volume], [slack])
    # Beyond the lower side the map goes on, beyond the upper one points stay.
    np.testing.assert_allclose(deform(below), [[-0.02, 0.5, 0.5]], atol=1e-15)
    assert np.array_equal(deform(above), above)
    np.testing.assert_allclose(jacobian(below)[0], np.diag([2.0, 1, 1]), atol=1e-15)
    assert np.array_equal(jacobian(above)[0], np.eye(3))
    on = np.array([[1.0, 0.5, 0.0]])
    np.testing.assert_allclose(deform(on), [[2.0, 0.5, 0.0]], atol=1e-15)


def test_one_number_is_for_all_sides_of_all_boxes():
    volume = stretched()
    beyond = np.array([[3.0, 0.5, -2.0]])
    np.testing.assert_allclose(deformation([volume], np.inf)(beyond), [[6.0, 0.5, -2.0]])
    assert np.array_equal(deformation([volume, volume], 0.0)(beyond), beyond)
