"""The paper's embedding: places move with the parameters the volume at rest gives them."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import fsolve

from ffdcli.volume.adaptive.inverse_map import InverseMap
from ffdcli.volume.adaptive.octree_growth import grow
from ffdcli.volume.adaptive.tspline import tspline_volume
from support.volume_trees import BOX, FRAME, ball, shaken

SIZE = float(np.linalg.norm(BOX[1] - BOX[0]))


@pytest.fixture(scope="module")
def rest():
    return InverseMap.of(tspline_volume(grow(ball(), None, 3), BOX, (100.0, 1.0), FRAME))


def surface(count: int = 60):
    """Points of the ball in the box."""
    return ball().reshape(-1, 3)[:: len(ball()) * 3 // count] * BOX[1]


def quotient(volume, points, weights, at):
    """``sum w P_i B_i / sum w B_i`` at one place, by the sums of the definition."""
    row = volume.displacement.basis_matrix(at[None]).toarray()[0] * weights
    return row @ points / row.sum()


def by_definition(volume, points, weights, place):
    """``P1(u)`` with ``P0(u) = x``, the equation solved by scipy with differences."""

    def miss(u):
        return quotient(volume, volume.rest_points, volume.rest_weights, u) - place

    u, _, done, _ = fsolve(miss, place, xtol=1e-14, full_output=True)
    assert done == 1 or np.linalg.norm(miss(u)) < 1e-12
    return quotient(volume, points, weights, u)


@pytest.mark.parametrize("reweighed", [False, True])
def test_images_are_those_of_the_definition(rest, reweighed):
    random = np.random.default_rng(3)
    points = rest.rest_points + 0.1 * random.uniform(-1, 1, rest.rest_points.shape)
    weights = rest.rest_weights * (random.uniform(0.5, 2, rest.shape) if reweighed else 1.0)
    edited = rest.with_control(points, weights)
    assert isinstance(edited, InverseMap)
    places = surface(20)
    expected = [by_definition(rest, points, weights, place) for place in places]
    found = edited.evaluate(places)
    assert np.abs(found - expected).max() < 1e-11 * SIZE
    # It is not what displacement makes of the same control points.
    assert np.abs(found - edited.displacement.evaluate(places)).max() > 1e-4 * SIZE


def test_at_rest_it_is_the_identity(rest):
    places = surface()
    assert rest.parameters(places).solved.all()
    assert np.array_equal(rest.evaluate(places), places)
    # Through the definition, to what the equation is solved to.
    parameters = rest.parameters(places).parameters
    for place, at in zip(places[:10], parameters[:10], strict=True):
        image = quotient(rest, rest.rest_points, rest.rest_weights, at)
        assert np.linalg.norm(image - place) < 2e-12 * SIZE
    # The identity moves parameters all the same.
    assert np.abs(parameters - places).max() > 1e-3 * SIZE


def test_derivatives_are_those_of_differences(rest):
    edited = shaken(rest)
    places, step = surface(20), 1e-6
    slopes = edited.jacobian(places)
    for axis in range(3):
        ahead, behind = (
            edited.evaluate(places + sign * step * np.eye(3)[axis]) for sign in (1, -1)
        )
        assert np.abs((ahead - behind) / (2 * step) - slopes[:, :, axis]).max() < 1e-6


def test_basis_is_that_of_the_parameters(rest):
    """So that drags solved with it move images where they should."""
    edited, places = shaken(rest), surface(20)
    rows = edited.basis_matrix(places).toarray() * rest.rest_weights
    moved = (rows @ (edited.net[:, :3] / edited.net[:, 3:])) / rows.sum(axis=1, keepdims=True)
    assert np.abs(places + moved - edited.evaluate(places)).max() < 1e-12 * SIZE


def test_outside_the_box_nothing_moves(rest):
    beyond = np.array([[1.5, 1.0, 1.0], [-0.1, 0.2, 0.3]])
    assert np.array_equal(shaken(rest).evaluate(beyond), beyond)
    assert np.array_equal(shaken(rest).jacobian(beyond), [np.eye(3)] * 2)


def test_it_is_no_volume(rest):
    assert rest.needs_fit
    assert not hasattr(rest, "restrict")
    assert not rest.displacement.needs_fit


def test_plans_of_the_two_embeddings_do_not_serve_each_other(rest):
    volumes = (rest, rest.displacement)
    for one, other in pairwise((*volumes, volumes[0])):
        assert not one.same_basis(other)
        assert one.same_basis(one)
