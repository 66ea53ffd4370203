"""How far edits scale: proved below, folded above, both seen by an oracle."""

import numpy as np
import pytest

from ffdcli.folds.domain import WholeBox
from ffdcli.folds.scaling import find_scale_limit
from ffdcli.volume.weights import homogeneous
from support.injective_models import at_rest, grid, oracle, shaken
from support.volume_trees import all_kinds


def path(volume):
    """The volume with its points and weights part of the way from rest."""
    rest = volume.rest_points
    points, weights = volume.net, np.ones(volume.shape)
    if volume.net.shape[3] == 4:
        points, weights = volume.net[..., :3] / volume.net[..., 3:], volume.net[..., 3]
    return lambda s: volume.with_net(homogeneous(rest + s * (points - rest), 1 + s * (weights - 1)))


@pytest.mark.parametrize("heavy", [1.0, 3.0])
@pytest.mark.parametrize("degrees", [(3, 3, 3), (2, 1, 3), (1, 1, 1)])
def test_below_it_is_injective_and_above_it_is_not(degrees, heavy):
    counts = tuple(k + 2 for k in degrees)
    scaled = path(shaken(degrees, counts, 0.6, 5, heavy=heavy))
    box = WholeBox(scaled(0).box)
    limit = find_scale_limit(scaled, box, 8.0)
    assert limit.folds is not None
    assert 0.98 * limit.folds <= limit.proved < limit.folds
    for s in (0.2, 0.6, 0.9, 1.0):
        assert oracle(scaled(s * limit.proved), grid(scaled(0))).min() > 0
    above = scaled(limit.folds)
    assert oracle(above, limit.at[None])[0] == pytest.approx(limit.value, abs=1e-6)
    assert limit.value < 0


def test_what_never_folds_is_proved_all_the_way():
    rest = at_rest((3, 2, 2), (5, 4, 4))
    limit = find_scale_limit(path(rest.with_net(rest.net + [3, 0, 1])), WholeBox(rest.box), 16.0)
    assert (limit.proved, limit.folds, limit.at) == (16.0, None, None)


def test_a_known_limit():
    """A squeeze along u: the slope is 1 - s everywhere."""
    rest = at_rest((2, 2, 2), (4, 4, 4))
    squeezed = rest.with_net(rest.net * [0, 1, 1])
    limit = find_scale_limit(path(squeezed), WholeBox(rest.box), 4.0)
    assert limit.proved <= 1 <= limit.folds
    assert limit.proved == pytest.approx(1, rel=0.01)
    assert limit.folds == pytest.approx(1, rel=0.01)


def test_with_less_effort_less_is_proved_and_nothing_is_claimed():
    scaled = path(shaken((3, 2, 2), (5, 4, 4), 0.6, 5, heavy=3.0))
    box = WholeBox(scaled(0).box)
    whole = find_scale_limit(scaled, box, 8.0)
    assert whole.complete
    assert whole.effort > 0
    before = 0.0
    for share in (0.0, 0.02, 0.2):
        effort = int(share * whole.effort)
        limit = find_scale_limit(scaled, box, 8.0, effort)
        assert limit.effort <= effort
        assert before <= limit.proved < whole.folds
        assert limit.complete == (limit.proved >= 0.995 * limit.folds)
        before = limit.proved
    assert not find_scale_limit(scaled, box, 8.0, 0).complete


def test_each_step_is_told_and_counted():
    told = []
    scaled = path(shaken((1, 1, 1), (3, 3, 3), 0.6, 5))
    limit = find_scale_limit(scaled, WholeBox(scaled(0).box), 8.0, progress=told.append)
    assert len(told) == limit.steps <= 24
    assert told[0] == "scale: proved up to 0, step 1 of at most 24"


def test_scales_of_two_quotients():
    """A T-spline whose weights are edited: both quotients, and one alone at rest."""
    volume = all_kinds()["weights"]
    points = volume.rest_points.copy()
    points[::3, 2] -= 0.3 * np.ptp(volume.box[:, 2])
    weights = volume.rest_weights * np.linspace(1, 1.4, len(points))
    rest = volume.rest_points

    def scaled(s):
        change = s * (weights - volume.rest_weights)
        return volume.with_control(rest + s * (points - rest), volume.rest_weights + change)

    assert scaled(0).net.shape[1] == 4
    assert scaled(1).net.shape[1] == 8
    limit = find_scale_limit(scaled, WholeBox(volume.box), 2.0, 3_000_000_000)
    assert limit.steps > 0
    assert limit.effort <= 3_000_000_000
    if limit.proved:
        at = np.random.default_rng(0).uniform(*volume.box, (500, 3))
        assert np.linalg.det(scaled(limit.proved).jacobian(at)).min() > 0
