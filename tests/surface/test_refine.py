"""Further cuts: strips stay in their slab, and weights of surfaces stay positive."""

from __future__ import annotations

import re

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from ffdcli.surface import refine
from ffdcli.surface.partition import partition
from ffdcli.surface.refine import MOST_GROWTH, keep_overshoot_small, keep_weights_positive
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.weights import homogeneous
from support.surface_models import (
    Stages,
    box_mesh,
    find_facets,
    make_volume,
    run,
    strips,
    turn,
    zoo,
)


def farthest(stages: Stages) -> float:
    """Longest way of a control point of a surface where those of the lattice go 1 along each axis.

    At rest all control points of surfaces lie on the planes, whatever the knots are, and the
    largest sum of absolute weights is found by giving each displacement its weight's sign; random
    signs come near it.
    """
    rng = np.random.default_rng(0)
    net = stages.volume.net
    worst = 0.0
    for _ in range(20):
        moved = net + rng.choice([-1.0, 1.0], net.shape)
        for batch in stages.patches:
            rows = np.arange(batch.count)
            way = batch.control_points(moved, rows) - batch.control_points(net, rows)
            worst = max(worst, float(np.abs(way).max()))
    return worst


def test_strips_are_cut_until_their_control_points_stay_near() -> None:
    volume = make_volume(-0.5, 0.5, (3, 3, 3), (16, 16, 16))
    for body in strips():
        stages = run(*body, volume)
        assert farthest(stages) <= MOST_GROWTH
        # The control points of a diagonal needle would lie far away if it were not cut.
        assert len(stages.parts.patch) > 12


@pytest.mark.parametrize("clamped", [False, True])
def test_control_points_of_all_kinds_of_planes_stay_near(clamped: bool) -> None:
    stages = run(*zoo(), make_volume(-0.6, 0.6, (2, 3, 1), (7, 6, 9), clamped=clamped))
    assert farthest(stages) <= MOST_GROWTH


def plate() -> tuple[np.ndarray, np.ndarray]:
    """A thin square plate whose large sides slope along all axes."""
    normal = np.array([4.0, 1.0, 0.8]) / np.linalg.norm([4.0, 1.0, 0.8])
    first = np.cross(normal, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    axes = np.array([first, np.cross(normal, first), normal])
    return box_mesh(np.array([1.0, 1.0, 0.2]), axes.T)


HALVE = refine._halve


@pytest.mark.parametrize(("gap", "faces"), [(1e-3, 20), (1e-4, 25), (1e-5, 40)])
def test_close_knots_cut_no_more_than_digits_need(gap: float, faces: int) -> None:
    """The third derivative between them is at most in 1 / gap: so the strip may be gap ** (1/3)."""
    knots = (np.array([0.4, 0.4 + gap]), np.array([]), np.array([]))
    volume = make_volume(-0.75, 0.75, (3, 3, 3), (6, 4, 4), interior=knots)
    stages = run(*plate(), volume)
    assert farthest(stages) <= MOST_GROWTH
    assert len(stages.parts.patch) < faces


def test_cuts_into_very_many_faces_are_foretold_or_refused(monkeypatch) -> None:
    knots = (np.array([0.4, 0.4 + 1e-5]), np.array([]), np.array([]))
    volume = make_volume(-0.75, 0.75, (3, 3, 3), (6, 4, 4), interior=knots)
    monkeypatch.setattr(refine, "_MANY_FACES", 2)
    vertices, triangles = plate()
    facets = find_facets(vertices, triangles, volume, delta=1e-9)
    parts = partition(vertices[:, None], triangles, facets)
    told = []

    def halve(parts, chosen):
        # It is told before the first cut.
        assert len(told) == 1
        return HALVE(parts, chosen)

    monkeypatch.setattr(refine, "_halve", halve)
    _, (warning,), _ = keep_overshoot_small(parts, warn=told.append)
    assert told == [warning]
    assert re.search(r"between the knots 0\.\d+ and 0\.\d+ of u .* about \d+ pieces", warning)
    monkeypatch.setattr(refine, "_MOST_FACES", 3)
    with pytest.raises(LatticeError, match="3 are allowed"):
        keep_overshoot_small(parts)


def test_planes_that_stay_planes_are_left_whole_if_asked() -> None:
    knots = (np.array([0.4, 0.4 + 1e-5]), np.array([]), np.array([]))
    volume = make_volume(-0.75, 0.75, (3, 3, 3), (6, 4, 4), interior=knots, amount=0.0)
    vertices, triangles = plate()
    facets = find_facets(vertices, triangles, volume, delta=1e-9)
    parts = partition(vertices[:, None], triangles, facets)
    whole, _, depends = keep_overshoot_small(parts, spare_planes=True)
    assert whole is parts
    assert depends
    cut, _, depends = keep_overshoot_small(parts)
    assert len(cut.patch) > len(parts.patch)
    assert not depends


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


def test_interpolated_patches_follow_the_same_rule() -> None:
    knots = (np.array([]), np.array([0.4, 0.4 + 1e-3]), np.array([]))
    volume = make_volume(-0.75, 0.75, (3, 3, 3), (4, 6, 4), interior=knots)
    stages = run(*plate(), volume, patches="paper")
    corners = stages.parts.rectangles.corners
    middle = (stages.parts.low + stages.parts.high) / 2
    inside = stages.parts.inside
    low, high = corners.min(axis=1)[inside], corners.max(axis=1)[inside]
    cells = volume.cells(middle[inside])
    bounds = volume.cell_bounds(cells)
    thick = bounds[:, 1] - bounds[:, 0]
    beyond = np.maximum(high - bounds[:, 1], bounds[:, 0] - low) >= thick
    growth = volume.restrict(cells, low, high).growth
    assert beyond.any()
    assert growth[beyond.any(axis=1)].max() <= MOST_GROWTH
    # Strips no longer than the slab is thick would number some hundred.
    assert len(stages.parts.patch) < 40
