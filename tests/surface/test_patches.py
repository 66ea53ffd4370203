"""Degrees and breaks of patches, and images of patches and curves."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.surface.facets import Patches
from support.surface_models import Stages, box_mesh, evaluate_spline, make_volume, run, turn, zoo

DEGREES = (1, 2, 3)
KINDS = get_args(Patches)


@pytest.mark.parametrize(
    ("rotation", "kinds"),
    [
        (np.eye(3), {(2, 3), (1, 3), (1, 2)}),
        # parallel to one axis: the paper's Table 1
        (turn([1, 0, 0], 0.4), {(2, 3), (1, 5)}),
        (turn([0, 1, 0], 0.4), {(1, 3), (2, 4)}),
        (turn([0, 0, 1], 0.4), {(1, 2), (3, 3)}),
    ],
)
def test_degrees_of_planes_parallel_to_an_axis(
    rotation: np.ndarray, kinds: set[tuple[int, int]]
) -> None:
    stages = run(*box_mesh(0.5, rotation), make_volume(-0.5, 0.5, DEGREES, (2, 3, 4)))
    assert {tuple(sorted(batch.degrees)) for batch in stages.patches} == kinds


def test_degrees_follow_the_table_of_the_design() -> None:
    """(k_b + [beta != 0] k_a) x (k_c + [gamma != 0] k_a), for every order of axes."""
    stages = run(*zoo(), make_volume(-0.5, 0.5, (2, 3, 4), (5, 5, 6)))
    seen = set()
    for batch in stages.patches:
        a, b, c = batch.order
        k = (2, 3, 4)
        slopes = stages.parts.graphs.slopes[batch.patches]
        assert ((slopes != 0) == batch.sloping).all()
        expected = (k[b] + batch.sloping[0] * k[a], k[c] + batch.sloping[1] * k[a])
        assert batch.degrees == expected
        seen.add((a, *batch.sloping))
    assert len({a for a, *_ in seen}) == 3
    assert len({tuple(slope) for _, *slope in seen}) >= 3


def test_a_general_plane_needs_lower_degrees_than_in_the_paper() -> None:
    rotated = box_mesh(0.5, turn([0.3, -0.5, 0.8], 0.83))
    for k, expected in [(2, (4, 4)), (3, (6, 6))]:
        stages = run(*rotated, make_volume(-0.5, 0.5, (k, k, k), (k + 3, k + 2, k + 4)))
        assert {batch.degrees for batch in stages.patches} == {expected}


def test_breaks_carry_the_continuity_of_the_volume() -> None:
    """Multiplicity ``degree - (k - m)`` at a knot of multiplicity m; ends are no breaks."""
    interior = (np.array([0.2, 0.5, 0.5, 0.7]), np.array([0.4, 0.6, 0.6]), np.array([0.3, 0.8]))
    k = (3, 3, 3)
    volume = make_volume(0.0, 1.0, k, (8, 7, 6), interior=interior)
    knots = [np.unique(part, return_counts=True) for part in interior]
    stages = run(*box_mesh(1.0, None, 0.5), volume)
    for batch in stages.patches:
        for i, axis in enumerate(batch.order[1:]):
            np.testing.assert_array_equal(batch.breaks[i][0, 1:-1], knots[axis][0])
            np.testing.assert_array_equal(batch.mults[i], knots[axis][1])
    tilted = run(*box_mesh(0.6, turn([0.3, -0.5, 0.8], 0.83), 0.5), volume)
    for batch in tilted.patches:
        for i, axis in enumerate(batch.order[1:]):
            counts = dict(zip(*knots[axis], strict=True))
            for row in batch.breaks[i]:
                expected = [batch.degrees[i] - (k[axis] - counts[value]) for value in row[1:-1]]
                np.testing.assert_array_equal(batch.mults[i], expected)


def test_knots_of_the_dominant_axis_become_breaks_where_one_slope_is_zero() -> None:
    volume = make_volume(-0.5, 0.5, (3, 2, 2), (7, 4, 6))
    stages = run(*box_mesh([0.4, 0.6, 0.5], turn([0, 0, 1], 0.5)), volume)
    merged = 0
    for batch in stages.patches:
        if sum(batch.sloping) != 1:
            continue
        i = batch.sloping.index(True)
        a, b = batch.order[0], batch.order[1 + i]
        for row, patch in zip(batch.breaks[i], batch.patches, strict=True):
            a0, *rest = stages.parts.graphs.anchor[patch]
            slope, b0 = stages.parts.graphs.slopes[patch, i], rest[i]
            images = (volume.knot_planes(a, volume.box[None]).values[0] - a0) / slope + b0
            own = volume.knot_planes(b, volume.box[None]).values[0]
            expected = np.sort(np.concatenate([images, own]))
            expected = expected[(expected > row[0]) & (expected < row[-1])]
            np.testing.assert_allclose(row[1:-1], expected, rtol=0, atol=1e-15)
            merged += 1
    assert merged == 4
    # None of this cut anything: the box is still six faces.
    assert len(stages.parts.patch) == 6


def test_coinciding_breaks_take_the_larger_multiplicity_at_the_knot_of_b() -> None:
    """On the plane u + v = 0.3 the double knot u = 0.1 meets the simple knot v = 0.2."""
    volume = make_volume(
        -0.5, 0.5, (3, 3, 3), (6, 5, 4),
        interior=(np.array([0.6, 0.6]), np.array([0.7]), np.array([])),
    )  # fmt: skip
    values = [volume.knot_planes(axis, volume.box[None]).values[0, 0] for axis in range(2)]
    side = 0.3 * np.sqrt(2)
    stages = run(*box_mesh([side, side, 0.6], turn([0, 0, 1], np.pi / 4)), volume)
    met = 0
    for batch in stages.patches:
        if sum(batch.sloping) != 1:
            continue
        i = batch.sloping.index(True)
        for row, patch in zip(batch.breaks[i], batch.patches, strict=True):
            assert (np.diff(row) > stages.epsilon).all()
            outward = stages.groups.normal[stages.parts.group[patch]]
            if outward[0] > 0.5 and outward[1] > 0.5:
                assert row[1:-1].tolist() == [values[batch.order[1 + i]]]
                assert batch.mults[i].tolist() == [6 - (3 - 2)]
                met += 1
    assert met == 1


def check_images(stages: Stages, rng: np.random.Generator, limit: float) -> None:
    """S(b, c) = D(plane point) inside every piece, and curves = D(segment)."""
    volume, parts = stages.volume, stages.parts
    patch_of = parts.patch[parts.region]
    for batch in stages.patches:
        poles = batch.control_points(volume.net, np.arange(len(batch.patches)))
        for i, patch in enumerate(batch.patches):
            piece = rng.choice(np.flatnonzero(patch_of == patch))
            corners = parts.pieces.corners[
                parts.pieces.starts[piece] : parts.pieces.starts[piece + 1]
            ]
            points = rng.dirichlet(np.ones(len(corners)), 4) @ stages.places[corners]
            a, b, c = parts.graphs.axes[patch]
            which = np.full(len(points), patch)
            points[:, a] = parts.graphs.height(which, points[:, b], points[:, c])
            points = np.clip(points, volume.box[0], volume.box[1])
            at = points[:, [b, c]]
            if parts.rectangles is not None:
                at = parts.rectangles.parameters(points[None], np.array([patch]))[0]
            image = evaluate_spline(batch, i, poles[i], at)
            allowed = limit + batch.rounding(volume)
            assert np.abs(image - volume.evaluate(points)).max() <= allowed
    for batch in stages.curves:
        poles = batch.control_points(volume.net, np.arange(len(batch.edges)))
        for i, edge in enumerate(batch.edges):
            p, q = stages.places[stages.outlines.edges[edge]]
            t = rng.random(4)
            points = np.clip(p + t[:, None] * (q - p), volume.box[0], volume.box[1])
            image = evaluate_spline(batch, i, poles[i], t[:, None])
            assert np.abs(image - volume.evaluate(points)).max() <= limit


@settings(max_examples=20)
@given(
    st.tuples(*[st.integers(1, 4)] * 3),
    st.tuples(*[st.integers(0, 5)] * 3),
    st.booleans(),
    st.sampled_from(KINDS),
    st.integers(0, 2**32 - 1),
)
def test_surfaces_and_curves_are_the_image(
    degrees: tuple[int, int, int],
    more: tuple[int, int, int],
    clamped: bool,
    patches: Patches,
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    counts = tuple(k + 1 + n for k, n in zip(degrees, more, strict=True))
    axis = rng.permutation([[1, 0, 0], rng.normal(size=3)])[0]
    mesh = box_mesh(rng.uniform(0.2, 0.5, 3), turn(axis, rng.uniform(0, 3)))
    volume = make_volume(-0.5, 0.5, degrees, counts, clamped=clamped, seed=seed)
    check_images(run(*mesh, volume, patches=patches), rng, 2e-13)


@pytest.mark.parametrize("patches", KINDS)
def test_surfaces_and_curves_of_all_kinds_are_the_image(patches: Patches) -> None:
    stages = run(*zoo(), make_volume(-0.5, 0.5, (3, 2, 3), (7, 6, 5)), patches=patches)
    check_images(stages, np.random.default_rng(0), 1e-14)
