"""Every map of a lattice box answers what later stages ask, whatever its kind."""

import numpy as np
import pytest

from ffdcli.splines.knots import greville, make_knots
from ffdcli.volume.adaptive.inverse_map import InverseMap
from ffdcli.volume.adaptive.tspline import tspline_volume
from ffdcli.volume.bspline import BSplineVolume
from support.volume_trees import BOX, FRAME, all_kinds, places, tree_with_junctions


def bspline():
    degrees, counts = (3, 2, 1), (6, 4, 5)
    knots = tuple(
        make_knots(k, n, *BOX[:, axis], interior=None, clamped=True)
        for axis, (k, n) in enumerate(zip(degrees, counts, strict=True))
    )
    axes = [greville(t, k) for t, k in zip(knots, degrees, strict=True)]
    net = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return BSplineVolume(degrees, knots, net, FRAME)


MAPS = {
    **all_kinds(),
    "bspline": bspline(),
    "inverse": InverseMap.of(tspline_volume(tree_with_junctions(), BOX, (10.0, 1.0), FRAME)),
}


@pytest.mark.parametrize("name", MAPS)
def test_control_points_have_levels_weights_and_places(name):
    one = MAPS[name]
    assert one.levels.shape == one.hidden.shape == one.rest_weights.shape == one.shape
    assert one.rest_points.shape == (*one.shape, 3)
    assert one.levels.min() >= 0
    assert one.same_basis(one)
    low, high = one.supports()
    assert np.all(low < high)
    assert len(low) == np.prod(one.shape)


@pytest.mark.parametrize("name", MAPS)
def test_linear_precision_means_that_control_points_at_rest_give_the_place(name):
    one, at = MAPS[name], places(30)
    basis = one.basis_matrix(at).toarray() * one.rest_weights.ravel()
    found = basis @ one.rest_points.reshape(-1, 3)
    if one.linear_precision:
        level = one.complete_level(np.stack([at, at], axis=1))
        chosen = one.levels.ravel() == level
        found = basis[:, chosen] @ one.rest_points.reshape(-1, 3)[chosen]
        assert np.abs(found - at).max() < 1e-12
    else:
        assert np.abs(found / basis.sum(axis=1, keepdims=True) - at).max() > 1e-3


@pytest.mark.parametrize("name", MAPS)
def test_only_the_inverse_map_needs_a_fit(name):
    one, at = MAPS[name], places(20)
    assert one.needs_fit == (name == "inverse")
    assert one.has_parameters(at).all() or one.needs_fit
    if not one.needs_fit:
        restriction = one.at_points(one.cells(at), at)
        values = restriction.apply(one.net)[:, 0, 0, 0]
        assert np.abs(one.net_kind.images(values, at) - one.evaluate(at)).max() < 1e-12
        assert (restriction.as_tensor is None) == (one.slope_sums(at) is None)
