"""Planar groups: distance to the group's own plane, not neighbour to neighbour."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.surface.planes import PlaneGroups, divide, find_planes, join_parallel
from support.surface_models import box_mesh, together, turn

seeds = st.integers(0, 2**32 - 1)


def find(vertices: np.ndarray, triangles: np.ndarray, delta: float) -> PlaneGroups:
    return find_planes(vertices, triangles, np.arange(len(triangles)), delta)


def check_plane(groups: PlaneGroups, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """What a group says about its plane, by direct calculation."""
    corners = vertices[triangles]
    normal, point = groups.normal[groups.group], groups.point[groups.group]
    off = np.abs(np.einsum("tci,ti->tc", corners - point[:, None], normal)).max(axis=1)
    worst = np.zeros(len(groups.normal))
    np.maximum.at(worst, groups.group, off)
    # Two ways to sum products: they differ by the rounding of the largest coordinate.
    rounding = 8 * np.spacing(np.abs(vertices).max())
    np.testing.assert_allclose(worst, groups.deviation, rtol=0, atol=rounding)
    np.testing.assert_allclose(np.linalg.norm(groups.normal, axis=1), 1, atol=1e-15)


def refined_box(count: int) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box().subdivide_to_size(1.5 / count)
    return np.array(box.vertices), np.array(box.faces, dtype=np.int64)


@settings(max_examples=25)
@given(seeds)
def test_coplanar_triangles_join(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, triangles = refined_box(int(rng.integers(1, 6)))
    vertices = vertices * rng.uniform(0.1, 10, 3) @ turn(rng.normal(size=3), rng.uniform(0, 6)).T
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    groups = find(vertices, triangles, 1e-9 * size)
    assert len(groups.normal) == 6
    check_plane(groups, vertices, triangles)
    outward = groups.point - vertices.mean(axis=0)
    assert (np.einsum("gi,gi->g", groups.normal, outward) > 0).all()


def test_polygons_that_do_not_touch_stay_apart_unless_asked() -> None:
    vertices, triangles = together(
        box_mesh(0.2, None, [-0.3, 0, 0]), box_mesh(0.2, None, [0.3, 0, 0])
    )
    groups = find(vertices, triangles, 1e-9)
    assert len(groups.normal) == 12
    joined = join_parallel(vertices, triangles, groups, 1e-9)
    # Four of the six planes of either box are the other's too; planes that face away are not.
    assert len(joined.normal) == 8
    check_plane(joined, vertices, triangles)


def test_a_finely_faceted_cylinder_does_not_drift_into_one_plane() -> None:
    """Neighbours are coplanar within delta here, but no large part of the wall is."""
    count, delta = 3000, 1e-6
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.concatenate(
        [np.column_stack([ring, np.full(count, z)]) for z in (0.0, 1.0)] + [[[0, 0, 0], [0, 0, 1]]]
    )
    i = np.arange(count)
    j = (i + 1) % count
    triangles = np.concatenate(
        [
            np.column_stack([i, j, j + count]),
            np.column_stack([i, j + count, i + count]),
            np.column_stack([j, i, np.full(count, 2 * count)]),
            np.column_stack([i + count, j + count, np.full(count, 2 * count + 1)]),
        ]
    )
    groups = find(vertices, triangles, delta)
    assert groups.deviation.max() <= delta
    check_plane(groups, vertices, triangles)
    wall = np.unique(groups.group[: 2 * count])
    caps = np.unique(groups.group[2 * count :])
    assert len(caps) == 2
    assert not np.intersect1d(wall, caps).size
    # A chord with sagitta 2 delta spans 2 acos(1 - 2 delta) of the circle.
    least = np.pi / np.arccos(1 - 2 * delta)
    assert least <= len(wall) <= count
    normals = groups.normal[groups.group[: 2 * count]]
    middle = np.concatenate([angle, angle]) + np.pi / count
    outward = np.column_stack([np.cos(middle), np.sin(middle)])
    turned = np.arccos(np.clip(np.einsum("ti,ti->t", normals[:, :2], outward), -1, 1))
    assert turned.max() < 0.01


@settings(max_examples=10)
@given(seeds)
def test_single_precision_noise_on_a_plane_joins(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, triangles = refined_box(12)
    vertices = 37.0 * vertices @ turn(rng.normal(size=3), rng.uniform(0, 6)).T + rng.uniform(
        -9, 9, 3
    )
    rounded = vertices.astype(np.float32).astype(np.float64)
    delta = 4 * float(np.spacing(np.float32(np.abs(rounded).max())))
    groups = find(rounded, triangles, delta)
    assert len(groups.normal) == 6
    assert groups.deviation.max() <= delta


def test_needles_join_the_plane_they_lie_in() -> None:
    """A vertex 1e-8 off an edge's middle gives a triangle whose normal says nothing."""
    rng = np.random.default_rng(3)
    count, delta = 12, 1e-7
    x = np.linspace(0, 1, count + 1)
    bottom = np.column_stack([x, np.zeros(count + 1), np.zeros(count + 1)])
    middle = np.column_stack([x[:-1] + 0.5 / count, np.full(count, 1e-8), np.zeros(count)])
    top = np.column_stack([x, np.ones(count + 1), np.zeros(count + 1)])
    vertices = np.concatenate([bottom, middle, top])
    vertices[:, 2] += rng.uniform(-0.5, 0.5, len(vertices)) * delta
    vertices = vertices @ turn([1, 2, 3], 0.7).T
    b = np.arange(count)
    m, t = b + count + 1, b + 2 * count + 1
    triangles = np.concatenate(
        [
            np.column_stack([b, b + 1, m]),
            np.column_stack([b + 1, t + 1, m]),
            np.column_stack([m, t + 1, t]),
            np.column_stack([m, t, b]),
        ]
    )
    groups = find(vertices, triangles, delta)
    assert len(groups.normal) == 1
    assert groups.deviation.max() <= delta


def test_triangles_of_one_polygon_are_one_group() -> None:
    """A quadrangle bent by more than delta is still one input polygon."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 1e-4], [0, 1, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    apart = find_planes(vertices, triangles, np.array([0, 1]), 1e-6)
    assert len(apart.normal) == 2
    one = find_planes(vertices, triangles, np.array([0, 0]), 1e-6)
    assert len(one.normal) == 1
    assert one.deviation[0] == pytest.approx(0.25e-4, rel=0.01)


def test_a_fold_of_coplanar_triangles_is_two_groups() -> None:
    """A thin plate's two sides share edges and a plane within delta, but face opposite ways."""
    vertices, triangles = box_mesh([1.0, 1.0, 1e-9])
    groups = find(vertices, triangles, 1e-8)
    up = np.cross(
        vertices[triangles[:, 1]] - vertices[triangles[:, 0]],
        vertices[triangles[:, 2]] - vertices[triangles[:, 0]],
    )[:, 2]
    top, bottom = groups.group[up > 0.5], groups.group[up < -0.5]
    assert len(np.unique(top)) == len(np.unique(bottom)) == 1
    assert top[0] != bottom[0]


def test_groups_are_divided_by_labels_and_keep_their_plane() -> None:
    vertices, triangles = refined_box(3)
    whole = find(vertices, triangles, 1e-9)
    label = (vertices[triangles].mean(axis=1)[:, 0] > vertices[:, 0].mean()).astype(np.int64)
    parts = divide(vertices, triangles, whole, label)
    check_plane(parts, vertices, triangles)
    pairs = np.unique(np.column_stack([whole.group, label]), axis=0)
    assert len(parts.normal) == len(pairs) > len(whole.normal)
    # Triangles are together where both plane and label are the same.
    assert len(np.unique(np.column_stack([parts.group, whole.group, label]), axis=0)) == len(pairs)
    former = np.empty(len(pairs), dtype=np.int64)
    former[parts.group] = whole.group
    assert np.array_equal(parts.normal, whole.normal[former])
    assert np.array_equal(parts.point, whole.point[former])
    points = vertices[triangles]
    for group in range(len(pairs)):
        inside = points[parts.group == group].reshape(-1, 3)
        assert np.array_equal(parts.low[group], inside.min(axis=0))
        assert np.array_equal(parts.high[group], inside.max(axis=0))
    assert divide(vertices, triangles, whole, np.zeros_like(label)) is whole
