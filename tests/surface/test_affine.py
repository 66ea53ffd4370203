"""Where the deformation is affine the exact result is a plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.surface.affine import AffineMaps, find_affine, plan_cells
from support.surface_models import Stages, box_mesh, make_volume, run, turn, zoo

seeds = st.integers(0, 2**32 - 1)


def maps(stages: Stages, net: np.ndarray) -> AffineMaps:
    cells = plan_cells(stages.patches, stages.parts)
    return find_affine([stages.volume.with_net(net)], cells, len(stages.parts.low))


@st.composite
def volumes(draw: st.DrawFn):
    degrees = tuple(draw(st.integers(1, 4)) for _ in range(3))
    counts = tuple(draw(st.integers(k + 1, 16)) for k in degrees)
    shift = draw(st.sampled_from([0.0, 0.25, 2.0]))
    return make_volume(
        shift - 0.5, shift + 0.5, degrees, counts, clamped=draw(st.booleans())
    )  # fmt: skip


@settings(max_examples=25)
@given(volumes(), seeds)
def test_rest_is_the_identity(volume, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, triangles = box_mesh(rng.uniform(0.2, 0.5, 3), turn(rng.normal(size=3), 1.0))
    stages = run(vertices + volume.box.mean(axis=0), triangles, volume)
    found = maps(stages, volume.rest_points)
    assert found.affine.all()
    limit = 1e-13 * max(1.0, np.abs(volume.box).max())
    assert np.abs(found.matrix - np.eye(3)).max() <= limit
    images = np.einsum("qij,qj->qi", found.matrix, stages.parts.low) + found.offset
    assert np.abs(images - stages.parts.low).max() <= 1e-14 * max(1, np.abs(volume.box).max())


@settings(max_examples=25)
@given(volumes(), seeds)
def test_an_affine_net_gives_planes(volume, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shear = np.eye(3) + rng.uniform(-0.4, 0.4, (3, 3))
    matrix = turn(rng.normal(size=3), 1.3) @ np.diag(rng.uniform(0.3, 2, 3)) @ shear
    offset = rng.uniform(-1, 1, 3)
    vertices, triangles = box_mesh(rng.uniform(0.2, 0.5, 3), turn(rng.normal(size=3), 1.0))
    stages = run(vertices + volume.box.mean(axis=0), triangles, volume)
    found = maps(stages, volume.rest_points @ matrix.T + offset)
    assert found.affine.all()
    scale = np.abs(matrix).max() * max(1.0, np.abs(volume.box).max())
    assert np.abs(found.matrix - matrix).max() <= 2e-13 * scale
    expected = stages.parts.high @ matrix.T + offset
    images = np.einsum("qij,qj->qi", found.matrix, stages.parts.high) + found.offset
    assert np.abs(images - expected).max() <= 1e-14 * scale * 4


def test_a_local_edit_leaves_far_patches_plane() -> None:
    volume = make_volume(-0.5, 0.5, (2, 2, 2), (8, 8, 8), amount=0.0)
    stages = run(*zoo(), volume)
    net = volume.rest_points.copy()
    net[0, 0, 0] += [0.1, -0.05, 0.2]
    found = maps(stages, net)
    # The corner's control point reaches two knot boxes along each axis: up to `reach`.
    reach = volume.knots[0][3]
    touched = (stages.parts.low < reach).all(axis=1)
    assert found.affine[~touched].all()
    assert not found.affine.all()
    at_corner = (stages.parts.low == -0.5).all(axis=1)
    assert at_corner.sum() == 3
    assert not found.affine[at_corner].any()


def test_a_bent_net_is_nowhere_affine() -> None:
    volume = make_volume(-0.5, 0.5, (3, 3, 3), (5, 6, 7))
    stages = run(*zoo(), volume)
    assert not maps(stages, volume.net).affine.any()


def test_outside_the_box_is_the_identity() -> None:
    volume = make_volume(-0.3, 0.3, (2, 2, 2), (4, 4, 4))
    stages = run(*zoo(), volume)
    found = maps(stages, volume.net)
    outside = ~stages.parts.inside
    assert outside.any()
    assert found.affine[outside].all()
    assert (found.matrix[outside] == np.eye(3)).all()
    assert (found.offset[outside] == 0).all()


@pytest.mark.parametrize("flattened", [0, 1, 2])
def test_a_map_that_flattens_space_leaves_no_plane(flattened: int) -> None:
    volume = make_volume(-0.5, 0.5, (2, 2, 2), (4, 4, 4), amount=0.0)
    stages = run(*box_mesh(0.5), volume)
    matrix = np.eye(3)
    matrix[flattened, flattened] = 0
    assert not maps(stages, volume.rest_points @ matrix).affine.any()
