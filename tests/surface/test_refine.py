"""Further cuts: strips stay in their slab, and weights of surfaces stay positive."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.surface.refine import keep_weights_positive
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.weights import homogeneous
from support.surface_models import Stages, box_mesh, make_volume, run, strips, turn, zoo


def test_overshoot_stays_under_one_slab() -> None:
    volume = make_volume(-0.5, 0.5, (3, 3, 3), (16, 16, 16))
    for body in strips():
        stages = run(*body, volume)
        assert overshoot(stages) < 1
        # A diagonal needle would overshoot by many slabs if it were not cut.
        assert len(stages.parts.patch) > 12


def overshoot(stages: Stages) -> float:
    """Largest excursion of a patch's rectangle beyond its slab, in slab thicknesses."""
    worst = 0.0
    for batch in stages.patches:
        if not all(batch.sloping):
            continue
        a = batch.order[0]
        graphs = stages.parts.graphs.take(batch.patches)
        rows = np.arange(len(batch.patches))
        middle = (stages.parts.low + stages.parts.high)[batch.patches] / 2
        box = stages.volume.box
        planes = stages.volume.knot_planes(a, box[None]).values[0]
        knots = np.unique(np.append(planes, box[:, a]))
        index = np.clip(np.searchsorted(knots, middle[:, a]), 1, len(knots) - 1)
        low, high = knots[index - 1], knots[index]
        for i in (0, -1):
            for j in (0, -1):
                at = graphs.height(rows, batch.breaks[0][:, i], batch.breaks[1][:, j])
                beyond = np.maximum(at - high, low - at) / (high - low)
                worst = max(worst, float(beyond.max()))
    return worst


@pytest.mark.parametrize("clamped", [False, True])
def test_overshoot_of_all_kinds_of_planes_stays_under_one_slab(clamped: bool) -> None:
    assert overshoot(run(*zoo(), make_volume(-0.6, 0.6, (2, 3, 1), (7, 6, 9), clamped=clamped))) < 1


def weighted(volume: BSplineVolume, spread: float) -> BSplineVolume:
    """The volume with random weights, from 1 / spread to spread."""
    exponent = np.random.default_rng(3).uniform(-1, 1, volume.shape)
    return volume.with_net(homogeneous(volume.net, spread**exponent))


def test_weights_of_surfaces_are_made_positive_by_cuts() -> None:
    volume = weighted(make_volume(-0.5, 0.5, (3, 3, 3), (8, 8, 8)), 300.0)
    stages = run(*box_mesh(0.54, turn([0.3, -0.5, 0.8], 0.83)), volume)
    every = [batch.weights(volume.net, np.arange(batch.count)) for batch in stages.patches]
    assert min(weights.min() for weights in every) <= 0
    parts, batches = keep_weights_positive(stages.parts)
    assert len(parts.patch) > len(stages.parts.patch)
    for batch in batches:
        poles = batch.control_points(volume.net, np.arange(batch.count))
        assert poles[..., 3].min() > 0


def test_polynomial_surfaces_are_not_cut() -> None:
    stages = run(*zoo(), make_volume(-0.5, 0.5, (2, 2, 2), (6, 5, 4)))
    assert keep_weights_positive(stages.parts)[0] is stages.parts
