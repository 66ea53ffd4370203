"""Cutting: areas, closedness, slabs, exact knot values, no slivers."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.corners import next_corners
from ffdcli.surface.facets import Patches
from support.surface_models import Stages, box_mesh, make_volume, run, turn, vector_areas, zoo

seeds = st.integers(0, 2**32 - 1)
KINDS = get_args(Patches)


def sphere(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    ball = trimesh.creation.icosphere(subdivisions=int(rng.integers(0, 3)), radius=0.5)
    rotation = turn(rng.normal(size=3), rng.uniform(0, 3))
    return np.array(ball.vertices) @ rotation.T, np.array(ball.faces, dtype=np.int64)


def soup(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    vertices = rng.uniform(-0.5, 0.5, (30, 3))
    return vertices, np.arange(30).reshape(10, 3)


def any_mesh(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    size = rng.uniform(0.2, 0.55, 3)
    return (
        lambda: box_mesh(size),
        lambda: box_mesh(size, turn([0, 0, 1], rng.uniform(0, 3))),
        lambda: box_mesh(size, turn(rng.normal(size=3), rng.uniform(0, 3))),
        lambda: sphere(rng),
        lambda: soup(rng),
    )[int(rng.integers(5))]()


def random_run(seed: int, *, reach: float = 0.5, patches: Patches = "merged") -> Stages:
    rng = np.random.default_rng(seed)
    vertices, triangles = any_mesh(rng)
    degrees = tuple(int(k) for k in rng.integers(1, 4, 3))
    counts = tuple(k + 1 + int(rng.integers(0, 6)) for k in degrees)
    middle = rng.uniform(-0.05, 0.05, 3)
    volume = make_volume(
        middle - reach, middle + reach, degrees, counts, clamped=bool(rng.integers(2))
    )
    return run(vertices, triangles, volume, patches=patches)


def piece_areas(stages: Stages) -> np.ndarray:
    """Vector area of every piece."""
    return vector_areas(stages.parts.pieces)


def directed_edges(stages: Stages) -> np.ndarray:
    pieces = stages.parts.pieces
    return np.column_stack([pieces.corners, pieces.corners[next_corners(pieces.starts)]])


def check_area(stages: Stages) -> None:
    triangles = stages.vertices[stages.triangles]
    whole = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    parts = np.zeros_like(whole)
    np.add.at(parts, stages.parts.pieces.triangle, piece_areas(stages))
    assert np.abs(parts - whole).max() <= 1e-15
    # Every piece faces the way its triangle does: nothing folded over.
    along = np.einsum("ni,ni->n", piece_areas(stages), whole[stages.parts.pieces.triangle])
    assert (along > 0).all()


def check_conforming(stages: Stages) -> None:
    """Every directed edge has its reverse exactly where the mesh had: no T-vertices."""
    edges = directed_edges(stages)
    keys = edges @ np.array([len(stages.places), 1])
    reverse = edges[:, ::-1] @ np.array([len(stages.places), 1])
    assert len(np.unique(keys)) == len(keys)
    tails, heads = stages.triangles.ravel(), np.roll(stages.triangles, -1, axis=1).ravel()
    there = set(zip(tails.tolist(), heads.tolist(), strict=True))
    if all((head, tail) in there for tail, head in there):
        assert np.array_equal(np.sort(keys), np.sort(reverse))


def check_vertices(stages: Stages) -> None:
    volume = stages.volume
    count = len(stages.vertices)
    assert stages.places[:count].tobytes() == stages.vertices.tobytes()
    made = stages.places[count:]
    for axis in range(3):
        planes = np.concatenate(
            [volume.knot_planes(axis, volume.box[None]).values[0], volume.box[:, axis]]
        )
        gap = np.abs(made[:, axis, None] - planes)
        assert not ((gap > 0) & (gap <= stages.epsilon)).any()


def check_slabs(stages: Stages, *, patches: Patches) -> None:
    parts, volume, eps = stages.parts, stages.volume, stages.epsilon
    patch = parts.patch[parts.region]
    inside = parts.inside[patch]
    for axis in range(3):
        planes = volume.knot_planes(axis, volume.box[None])
        low, high = parts.pieces.bounds(0, axis)
        box = volume.box[:, axis]
        assert (low[inside] >= box[0] - eps).all()
        assert (high[inside] <= box[1] + eps).all()
        sloping = parts.graphs.sloping[patch].all(axis=1)
        dominant = parts.graphs.axes[patch, 0] == axis
        for value, continuity in zip(planes.values[0], planes.continuity[0], strict=True):
            needed = (patches != "merged") | (continuity == 0) | (sloping & dominant)
            # A vertex this near may stay on the other side: no surface changes by it.
            limits = stages.limits
            slack = max(float(limits.snap(continuity)), float(limits.reach(continuity)))
            crossing = inside & needed & (low < value - slack) & (high > value + slack)
            assert not crossing.any()
    outside = ~inside
    corners = np.stack([np.column_stack(parts.pieces.bounds(0, axis)) for axis in range(3)], axis=1)
    middle = corners.mean(axis=2)
    clear = (middle < volume.box[0]) | (middle > volume.box[1])
    assert clear[outside].any(axis=1).all()


def check_outlines(stages: Stages) -> None:
    """Closed loops; each edge once each way; the outer loop first and counter-clockwise."""
    outlines, parts = stages.outlines, stages.parts
    ends = outlines.edges[outlines.coedge_edge]
    ends = np.where(outlines.coedge_forward[:, None], ends, ends[:, ::-1])
    region = np.repeat(
        np.repeat(np.arange(len(outlines.region_loops) - 1), np.diff(outlines.region_loops)),
        np.diff(outlines.loop_coedges),
    )
    for start, stop in zip(outlines.loop_coedges[:-1], outlines.loop_coedges[1:], strict=True):
        assert np.array_equal(ends[start:stop, 1], np.roll(ends[start:stop, 0], -1))
    left = np.where(outlines.coedge_forward, 0, 1)
    assert np.array_equal(outlines.edge_regions[outlines.coedge_edge, left], region)
    used = np.bincount(outlines.coedge_edge, minlength=len(outlines.edges))
    assert np.array_equal(used, (outlines.edge_regions >= 0).sum(axis=1))
    # Loops enclose the region's area, seen along its normal.
    normal = stages.groups.normal[parts.group[parts.patch]]
    vertices = stages.places
    origin = vertices[ends[outlines.loop_coedges[:-1], 0]]
    owner = np.repeat(np.arange(len(origin)), np.diff(outlines.loop_coedges))
    local = vertices[ends] - origin[owner][:, None]
    cross = np.cross(local[:, 0], local[:, 1]) / 2
    area = np.add.reduceat(np.einsum("ci,ci->c", cross, normal[region]), outlines.loop_coedges[:-1])
    total = np.zeros(len(parts.patch))
    loop_region = region[outlines.loop_coedges[:-1]]
    np.add.at(total, loop_region, area)
    whole = np.zeros(len(parts.patch))
    np.add.at(whole, parts.region, np.einsum("ni,ni->n", piece_areas(stages), normal[parts.region]))
    assert np.abs(total - whole).max() <= 1e-15
    first = outlines.region_loops[:-1]
    assert (area[first] > 0).all()
    inner = np.setdiff1d(np.arange(len(area)), first)
    assert (area[inner] < 0).all()


def euler(stages: Stages) -> int:
    outlines = stages.outlines
    loops = np.diff(outlines.region_loops)
    faces = int((2 - loops).sum())
    return len(np.unique(outlines.edges)) - len(outlines.edges) + faces


def check(stages: Stages, *, patches: Patches) -> None:
    check_area(stages)
    check_conforming(stages)
    check_vertices(stages)
    check_slabs(stages, patches=patches)
    check_outlines(stages)


@settings(max_examples=60)
@given(seeds, st.sampled_from(KINDS), st.sampled_from([0.6, 0.3]))
def test_cutting_keeps_what_must_be_kept(seed: int, patches: Patches, reach: float) -> None:
    stages = random_run(seed, reach=reach, patches=patches)
    check(stages, patches=patches)


@pytest.mark.parametrize("patches", KINDS)
@pytest.mark.parametrize("reach", [0.5, 0.37])
def test_cutting_the_zoo(patches: Patches, reach: float) -> None:
    stages = run(*zoo(), make_volume(-reach, reach, (2, 3, 1), (7, 6, 5)), patches=patches)
    check(stages, patches=patches)
    assert euler(stages) == 2 * 8


@settings(max_examples=30)
@given(seeds, st.sampled_from(KINDS), st.sampled_from([0.6, 0.3]))
def test_closed_mesh_gives_closed_outlines(seed: int, patches: Patches, reach: float) -> None:
    rng = np.random.default_rng(seed)
    mesh = sphere(rng) if rng.integers(2) else box_mesh(0.5, turn(rng.normal(size=3), 1.1))
    degrees = tuple(int(k) for k in rng.integers(1, 4, 3))
    counts = (degrees[0] + 3, degrees[1] + 1, degrees[2] + 6)
    stages = run(*mesh, make_volume(-reach, reach, degrees, counts), patches=patches)
    assert (stages.outlines.edge_regions >= 0).all()
    different = stages.outlines.edge_regions[:, 0] != stages.outlines.edge_regions[:, 1]
    assert different.all()
    assert euler(stages) == 2


def nudged_sphere(
    seed: int, planes: list[np.ndarray], delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """A sphere, many of whose vertices lie within a few delta of planes."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    vertices = np.array(ball.vertices) @ turn(rng.normal(size=3), rng.uniform(0, 3)).T
    steps = delta * np.array([0, 0.5, -0.5, 0.999, -0.999, 1.001, -1.001, 2])
    for axis, values in enumerate(planes):
        if not len(values):
            continue
        nearest = values[np.argmin(np.abs(vertices[:, axis, None] - values), axis=1)]
        close = np.abs(nearest - vertices[:, axis]) < 0.01
        shift = rng.choice(steps, len(vertices))
        vertices[:, axis] = np.where(close, nearest + shift, vertices[:, axis])
    return vertices, np.array(ball.faces, dtype=np.int64)


@settings(max_examples=25)
@given(seeds)
def test_vertices_near_knot_planes_make_no_slivers(seed: int) -> None:
    """A vertex within epsilon of a plane is on it; beyond, the cut keeps its distance."""
    delta = 1e-7
    volume = make_volume(-0.6, 0.6, (2, 2, 2), (3, 3, 15))
    planes = [volume.knot_planes(axis, volume.box[None]).values[0] for axis in range(3)]
    stages = run(*nudged_sphere(seed, planes, delta), volume, patches="bezier", delta=delta)
    check_area(stages)
    check_conforming(stages)
    edges = directed_edges(stages)
    vertices = stages.places
    length = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)
    # Kernels collapse edges shorter than this when they read the file.
    assert length.min() >= stages.limits.shortest_edge


@settings(max_examples=25)
@given(seeds)
def test_vertices_near_planes_of_all_axes_are_cut_soundly(seed: int) -> None:
    delta = 1e-7
    volume = make_volume(-0.6, 0.6, (2, 2, 2), (6, 5, 7))
    planes = [volume.knot_planes(axis, volume.box[None]).values[0] for axis in range(3)]
    stages = run(*nudged_sphere(seed, planes, delta), volume, patches="bezier", delta=delta)
    check_area(stages)
    check_conforming(stages)
    check_slabs(stages, patches="bezier")
    check_outlines(stages)
    assert euler(stages) == 2


def grid_box(count: int) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box().subdivide_to_size(1.5 / count)
    return np.array(box.vertices), np.array(box.faces, dtype=np.int64)


@pytest.mark.parametrize("amount", [0.3, 0.9])
@pytest.mark.parametrize("patches", KINDS)
def test_a_noisy_face_in_a_knot_plane_does_not_shatter(patches: Patches, amount: float) -> None:
    """The top of the box lies at w = 0.5, a knot, but for single-precision noise."""
    vertices, triangles = grid_box(8)
    volume = make_volume(-1.0, 1.0, (2, 2, 2), (4, 4, 6))
    assert 0.5 in volume.knot_planes(2, volume.box[None]).values[0]
    delta = 4 * float(np.spacing(np.float32(0.5)))
    noisy = vertices.copy()
    noise = np.random.default_rng(0).uniform(-1, 1, vertices.shape)
    noisy += amount * delta * noise
    clean = run(vertices, triangles, volume, patches=patches, delta=delta)
    rough = run(noisy, triangles, volume, patches=patches, delta=delta)
    assert len(rough.groups.normal) == len(clean.groups.normal) == 6
    top = rough.groups.normal[rough.groups.group][:, 2] > 0.5
    pieces = [
        np.bincount(s.parts.pieces.triangle, minlength=len(triangles)) for s in (clean, rough)
    ]
    assert np.array_equal(pieces[0][top], pieces[1][top])
    assert len(rough.parts.patch) == len(clean.parts.patch)
    if amount < 0.35:
        # Nearer than that the box's edges are straight within epsilon too.
        assert len(rough.outlines.edges) == len(clean.outlines.edges)
    check_area(rough)
    check_conforming(rough)


def on_a_diagonal() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A box and a tetrahedron whose edge lies on the diagonal along which the box's top is split.

    Vertices, triangles, and the polygon of each of these.
    """
    vertices, triangles = box_mesh([0.5, 0.8, 0.4])
    a, b = 1, 7
    assert [1, 5, 7] in triangles.tolist()
    assert [1, 7, 3] in triangles.tolist()
    above = vertices[[a, b]].mean(axis=0) + [[0.2, -0.1, 0.3], [-0.2, 0.1, 0.3]]
    on_top = [[a, b, 9], [b, a, 8], [a, 9, 8], [b, 8, 9]]
    polygon = np.concatenate([np.arange(12) // 2, [6, 7, 8, 9]])
    return np.concatenate([vertices, above]), np.concatenate([triangles, on_top]), polygon


@pytest.mark.parametrize("patches", KINDS)
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_diagonal_may_lie_on_an_edge_of_others(patches: Patches, angle: float) -> None:
    vertices, triangles, polygon = on_a_diagonal()
    vertices = vertices @ turn([1, -2, 3], angle).T
    volume = make_volume(-1.0, 1.0, (2, 2, 2), (9, 9, 9))
    stages = run(vertices, triangles, volume, patches=patches, polygon=polygon)
    check_area(stages)
    outlines, region = stages.outlines, stages.parts.region
    assert (outlines.edge_regions >= 0).all()
    # The two bodies have no edge in common, though they have vertices, and each is a sphere.
    body = np.zeros(len(stages.parts.patch), dtype=int)
    body[region] = stages.parts.pieces.triangle >= 12
    either = body[outlines.edge_regions]
    assert (either[:, 0] == either[:, 1]).all()
    for number in range(2):
        edges = outlines.edges[either[:, 0] == number]
        loops = np.diff(outlines.region_loops)[body == number]
        assert len(np.unique(edges)) - len(edges) + (2 - loops).sum() == 2
    # The planes that cut the top cut the edge above it as well, each at a vertex of its own.
    if patches != "merged":
        pairs = np.sort(outlines.edges, axis=1)
        assert len(np.unique(pairs, axis=0)) == len(pairs)


def test_a_collinear_corner_cut_off_on_both_sides() -> None:
    """Corners 0, 1, 4 in a row: both quads beside the row are split from its end to its end."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.9, 0], [0.4, 0.3, 0.8]]) - 0.3
    vertices = np.concatenate([corners, corners[:2].mean(axis=0, keepdims=True)])
    triangles = np.array([[0, 2, 1], [0, 1, 4], [0, 1, 3], [1, 0, 4], [1, 2, 3], [2, 0, 3]])
    for seed in range(20):
        rotated = vertices @ turn(np.random.default_rng(seed).normal(size=3), seed / 3).T
        volume = make_volume(-1.0, 1.0, (2, 2, 2), (5, 5, 5))
        stages = run(rotated, triangles, volume, polygon=np.array([0, 0, 1, 1, 2, 3]))
        assert (stages.outlines.edge_regions >= 0).all()
        normals = stages.groups.normal[stages.parts.group[stages.parts.patch]]
        assert len(np.unique(np.round(normals, 6), axis=0)) == 4
