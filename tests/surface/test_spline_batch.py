"""Batches of splines: matrices and weights agree with the composition."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.volume.weights import homogeneous
from support.surface_models import make_volume, run, zoo


@pytest.mark.parametrize("rational", [False, True])
def test_matrices_and_weights_agree_with_composition(rational: bool) -> None:
    volume = make_volume(-0.5, 0.5, (2, 3, 2), (6, 7, 5))
    if rational:
        weights = 2 ** np.random.default_rng(0).uniform(-1, 1, volume.shape)
        volume = volume.with_net(homogeneous(volume.net, weights))
    stages = run(*zoo(), volume)
    for batch in (*stages.patches, *stages.curves):
        every = np.arange(batch.count)
        points = batch.control_points(volume.net, every)
        assert points.shape == (batch.count, *batch.pole_counts, 4 if rational else 3)
        kept = batch.with_matrices()
        np.testing.assert_allclose(kept.control_points(volume.net, every), points, atol=1e-13)
        some = every[::3]
        np.testing.assert_array_equal(batch.control_points(volume.net, some).shape[0], len(some))
        np.testing.assert_allclose(
            kept.control_points(volume.net, some), points[some], rtol=0, atol=1e-13
        )
        if rational:
            found = batch.weights(volume.net, every)
            np.testing.assert_allclose(found[..., 0], points[..., 3], rtol=1e-14)
