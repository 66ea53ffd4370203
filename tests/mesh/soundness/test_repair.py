"""Repair: every kind of fault is mended and reported; no vertex moves; sound meshes stay so."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import MeshError
from ffdcli.mesh import (
    describe_faults,
    describe_remarks,
    inspect,
    read_mesh,
    repair,
    require_usable,
    triangles,
    usability,
)
from support.mesh_models import CORNERS, QUADS, binary_stl, cube_triangles, make

INWARD = [loop[::-1] for loop in QUADS]
SECOND = [[vertex + 8 for vertex in loop] for loop in QUADS]
MIDDLE = np.array([[0.5, 0, 1]])
TRIANGLES = [[a, b, c] for q in QUADS for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]


def loops(mesh):
    return [mesh.corners[a:b].tolist() for a, b in pairwise(mesh.starts)]


def sound(mesh):
    found = inspect(mesh)
    assert describe_faults(found) == []
    assert found.closed
    return found


@pytest.mark.parametrize(
    "mesh",
    [
        make(CORNERS, QUADS),
        make(CORNERS * 1e-4, QUADS),
        make(CORNERS + 1e9, QUADS),
        make(CORNERS, QUADS[:-1]),
        make(CORNERS[:4], [[0, 1, 3, 2]]),
        make(np.concatenate([CORNERS * 4, CORNERS + 1]), QUADS + [p[::-1] for p in SECOND]),
        make(np.concatenate([CORNERS, CORNERS + [1, 0, 0]]), QUADS + SECOND),
        make(np.concatenate([CORNERS, CORNERS + 0.5]), QUADS + SECOND),
        # A closed slab thinner than the weld reach, and a short edge of an open sheet.
        make(CORNERS * [1, 1, 1e-9], QUADS),
        make(np.array([[0, 0, 0], [1, 0, 0], [1, 1e-9, 0], [0, 1, 0]]), [[0, 1, 2, 3]]),
    ],
)
def test_sound_meshes_come_back_as_they_are(mesh):
    mended, done = repair(mesh)
    assert mended is mesh
    assert done == ()


# Name, vertices, polygons, what is said before, what is said of the repair, polygons after.
MENDED = {
    "turned polygon": (
        CORNERS,
        [*QUADS[:5], QUADS[5][::-1]],
        "4 edges join polygons wound in opposite directions, the first near (1, 0.5, 0)",
        "1 polygon was flipped to match the neighbours, the first near (1, 0.5, 0.5)",
        6,
    ),
    "inside out": (
        CORNERS * [1, 1, -1],
        QUADS,
        "1 closed body is inside out (its polygons face inwards), near (0.5, 0.5, 0)",
        "1 closed body was flipped to face outwards, the first near (0.5, 0.5, 0)",
        6,
    ),
    "polygon twice": (
        CORNERS,
        [*QUADS, QUADS[2]],
        "1 polygon lies on the same vertices as another, near (0.5, 0, 0.5)",
        "1 polygon was dropped because others have the same vertices, the first near (0.5, 0, 0.5)",
        6,
    ),
    "polygon twice, one turned": (
        CORNERS,
        [*QUADS, QUADS[2][::-1]],
        "4 edges are shared by more than two polygons, the first near (0.5, 0, 0)",
        "1 polygon was dropped because others have the same vertices, the first near (0.5, 0, 0.5)",
        6,
    ),
    "zero area": (
        CORNERS,
        [*QUADS, [0, 1, 1]],
        "1 polygon has no area, near (0.666666667, 0, 0)",
        "1 polygon without area was dropped, the first near (0.666666667, 0, 0)",
        6,
    ),
    "cap": (
        np.concatenate([CORNERS, MIDDLE]),
        [QUADS[0], [4, 8, 5, 7, 6], [4, 5, 8], *QUADS[2:]],
        "1 polygon has no area, near (0.5, 0, 1)",
        "1 vertex was inserted into open edges, the first at (0.5, 0, 1)",
        6,
    ),
    "needle": (
        np.concatenate([CORNERS, CORNERS[7:]]),
        [[0, 2, 3, 1], [4, 5, 7, 6], [7, 8, 6], [0, 1, 5, 4], [2, 6, 8, 7, 3], *QUADS[4:]],
        "1 polygon has no area, near (0.666666667, 1, 1)",
        "1 end of a polygon without area was welded to another at the same place, "
        "the first at (1, 1, 1)",
        6,
    ),
    "spike": (
        CORNERS,
        [[0, 2, 3, 1, 5, 1], *QUADS[1:]],
        "1 polygon crosses itself or doubles back, near (0.666666667, 0.333333333, 0.166666667)",
        "1 spike of an outline was removed",
        6,
    ),
    "edge of two bodies": (
        np.concatenate([CORNERS, CORNERS[[1, 3, 5, 7]] + [1, 0, 1], CORNERS[[4, 6]] + [1, 0, 1]]),
        # The second cube stands on the edge 5-7 of the first.
        [*QUADS, [5, 7, 9, 8], [12, 10, 11, 13], [5, 8, 10, 12], [7, 13, 11, 9], [5, 12, 13, 7],
         [8, 9, 11, 10]],
        "1 edge is shared by more than two polygons, near (1, 0.5, 1)",
        "2 vertices were doubled to separate surfaces that touch, the first at (1, 0, 1)",
        12,
    ),
    "wall of two bodies": (
        np.concatenate([CORNERS, CORNERS[[1, 3, 5, 7]] + [1, 0, 0]]),
        [*QUADS, [1, 3, 9, 8], [5, 10, 11, 7], [1, 8, 10, 5], [3, 7, 11, 9], [1, 5, 7, 3],
         [8, 9, 11, 10]],
        "4 edges are shared by more than two polygons, the first near (1, 0.5, 0)",
        "4 vertices were doubled to separate surfaces that touch, the first at (1, 0, 0)",
        12,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MENDED)
def test_faults_are_told_and_mended(name):
    vertices, polygons, told, did, count = MENDED[name]
    mesh = make(vertices, polygons)
    found = inspect(mesh)
    assert told in [what for what, _ in describe_faults(found)]
    assert usability(mesh, found) == "with --repair"
    with pytest.raises(MeshError, match="run again with --repair"):
        require_usable(mesh, found)
    mended, done = repair(mesh)
    assert f"repaired: {did}" in done
    assert mended.notes == done
    assert mended.polygon_count == count
    bodies = sound(mended).bodies
    assert inspect(mended).volumes.tolist() == pytest.approx([1.0] * bodies)
    # Nothing moved: every vertex is where one was.
    places = set(map(tuple, mesh.vertices.tolist()))
    assert set(map(tuple, mended.vertices.tolist())) <= places
    assert repair(mended) == (mended, ())


@pytest.mark.parametrize("step", [[1, 0, 0], [1, 0, 1], [0, -1, 1]])
def test_touching_bodies_of_an_stl_are_parted(tmp_path, step):
    """STL says nothing of bodies: at walls and edges they are found by the material between."""
    path = tmp_path / "two.stl"
    path.write_bytes(binary_stl(np.concatenate([cube_triangles(), cube_triangles() + step])))
    mesh = read_mesh(path)
    assert inspect(mesh).nonmanifold_edges.count > 0
    mended = read_mesh(path, repair=True)
    assert sound(mended).volumes == pytest.approx([1.0, 1.0])
    assert mended.polygon_count == mesh.polygon_count == 24


def test_surfaces_that_touch_in_a_point_are_told_and_parted():
    vertices = np.concatenate([CORNERS, CORNERS[1:] + 1])
    second = [[7 if vertex == 0 else vertex + 7 for vertex in loop] for loop in QUADS]
    mesh = make(vertices, QUADS + second)
    found = inspect(mesh)
    assert (found.nonmanifold_vertices.count, usability(mesh, found)) == (1, "yes")
    assert describe_remarks(mesh, found)[0].startswith(
        "1 vertex joins surfaces that touch in a point, at (1, 1, 1); "
    )
    mended, _ = repair(mesh)
    assert len(mended.vertices) == 16
    assert sound(mended).nonmanifold_vertices.count == 0


def test_vertices_within_rounding_are_welded_and_the_distance_is_said():
    rng = np.random.default_rng(3)
    corners = (cube_triangles() * 3 + [100, 200, 50]).astype(np.float32)
    moved = rng.random(corners.shape) < 0.3
    corners = np.where(moved, np.nextafter(corners, np.float32(1e9)), corners).astype(float)
    ulp = float(np.spacing(np.float32(200)))
    soup = make(corners.reshape(-1, 3), np.arange(36).reshape(-1, 3), resolution=4 * ulp)
    assert inspect(soup).open_edges.count == 36
    mended, done = repair(soup)
    found = sound(mended)
    assert len(mended.vertices) == 8
    assert found.volumes == pytest.approx([27.0], rel=1e-4)
    nearest = np.abs(mended.vertices[:, None] - corners.reshape(1, -1, 3)).max(axis=2).min(axis=1)
    assert nearest.max() == 0
    (what,) = done
    distance = float(what.partition("at most ")[2].split()[0])
    assert 0 < distance <= 1.001 * np.sqrt(3) * ulp
    assert mended.resolution >= distance / 1.05


def test_vertices_further_apart_than_the_numbers_allow_stay_apart():
    corners = cube_triangles().reshape(-1, 3)
    corners[0] += [1e-5, 0, 0]
    soup = make(corners, np.arange(36).reshape(-1, 3), resolution=1e-6)
    mended, _ = repair(soup)
    assert inspect(mended).open_edges.count > 0


def test_a_double_sided_sheet_loses_its_second_side():
    sheet = [[0, 1, 2], [0, 2, 3]]
    mesh = make([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], sheet + [p[::-1] for p in sheet])
    mended, _ = repair(mesh)
    assert loops(mended) == sheet
    assert describe_faults(inspect(mended)) == []


@pytest.mark.parametrize(
    ("outer", "inner", "volumes"),
    [
        (INWARD, SECOND, [64, -1]),  # a hollow body, its file inside out as a whole
        (INWARD, [p[::-1] for p in SECOND], [64, -1]),
    ],
)
def test_bodies_inside_out_and_cavities(outer, inner, volumes):
    mesh = make(np.concatenate([CORNERS * 4, CORNERS + 1]), outer + inner)
    mended, _ = repair(mesh)
    assert sound(mended).volumes == pytest.approx(volumes)


def test_what_cannot_be_mended_is_refused_with_place_and_advice():
    wall = make(CORNERS, [*QUADS, [0, 1, 7, 6]])
    twisted = make(CORNERS, [[0, 2, 1, 3], *QUADS[1:]])
    for mesh, words in ((wall, "delete the polygons inside"), (twisted, "split such polygons")):
        assert repair(mesh)[1] == ()
        assert usability(mesh, inspect(mesh)) == "no"
        with pytest.raises(MeshError, match=words) as caught:
            require_usable(mesh, inspect(mesh))
        assert "--repair" not in str(caught.value)


def test_what_repair_leaves_is_said_where_it_mends_a_part():
    mesh = make(CORNERS, [*QUADS, [0, 1, 7, 6], [2, 3, 3]])
    with pytest.raises(MeshError, match="--repair does not repair all: 2 edges are shared"):
        require_usable(mesh, inspect(mesh))


def test_a_moebius_band_cannot_be_wound_one_way():
    angle = np.arange(12) * np.pi / 6
    rim = np.array([-0.3, 0.3])[None, :, None]
    middle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])[:, None]
    across = np.cos(angle / 2)[:, None] * middle[:, 0] + np.outer(np.sin(angle / 2), [0, 0, 1])
    band = (middle + rim * across[:, None]).reshape(-1, 3)
    polygons = []
    for n in range(12):
        a, b, c, d = 2 * n, 2 * n + 1, (2 * n + 2) % 24, (2 * n + 3) % 24
        c, d = (d, c) if n == 11 else (c, d)
        polygons += [[a, c, b], [b, c, d]]
    mesh = make(band, polygons)
    with pytest.raises(MeshError, match="1 edge joins polygons wound in opposite directions"):
        require_usable(mesh, inspect(mesh))


def test_t_junctions_are_told_and_joined():
    vertices = np.concatenate([CORNERS, MIDDLE, [[0.25, 1e-10, 1]]])
    mesh = make(vertices, [QUADS[0], [4, 9, 8, 5, 7, 6], *QUADS[2:]])
    remarks = describe_remarks(mesh, inspect(mesh))
    assert remarks[0].startswith("the mesh is open: 4 edges belong to only one polygon")
    assert remarks[1].startswith("2 vertices lie in the middle of other polygons' open edges")
    mended, _ = repair(mesh)
    sound(mended)
    assert sorted(map(len, loops(mended))) == [4, 4, 4, 4, 6, 6]


def test_groups_follow_their_polygons():
    mesh = make(
        CORNERS,
        [[0, 1, 1], *QUADS, QUADS[0]],
        groups={"base": np.array([0, 1]), "top": np.array([2])},
    )
    mended, _ = repair(mesh)
    assert {name: each.tolist() for name, each in mended.groups.items()} == {
        "base": [0],
        "top": [1],
    }


def test_bodies_that_overlap_are_told():
    crossed = np.concatenate([CORNERS, CORNERS + [0.5, 0.5, 0.5]])
    mesh = make(crossed, QUADS + SECOND)
    assert inspect(mesh).overlaps.count == 2
    assert "2 closed bodies reach into others" in describe_remarks(mesh, inspect(mesh))[0]
    for step in ([1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0.5, 0.5], [2, 0, 0]):
        beside = make(np.concatenate([CORNERS, CORNERS + step]), QUADS + SECOND)
        assert inspect(beside).overlaps.count == 0


@settings(max_examples=60)
@given(st.data())
def test_any_damage_is_mended_or_told(data):
    """Turned, repeated and collapsed triangles of a cube, in any order, leave a sound cube."""
    polygons = [list(p) for p in TRIANGLES]
    for polygon in polygons:
        if data.draw(st.integers(0, 3)) == 0:
            polygon.reverse()
    for _ in range(data.draw(st.integers(0, 3))):
        polygons.append(list(data.draw(st.sampled_from(polygons))))
    for _ in range(data.draw(st.integers(0, 3))):
        a, b = data.draw(st.sampled_from(polygons))[:2]
        polygons.append([a, b, data.draw(st.sampled_from([a, b]))])
    polygons = data.draw(st.permutations(polygons))
    mesh = make(CORNERS, polygons)
    mended, done = repair(mesh)
    found = sound(mended)
    assert found.volumes == pytest.approx([1.0])
    assert mended.polygon_count == 12
    assert repair(mended) == (mended, ())
    if not done:
        assert mended is mesh


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        # To the hole and back along one edge.
        ([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]], 12),
        # Two holes on one bridge.
        ([[0, 0], [9, 0], [9, 4], [0, 4], [0, 0], [1, 1], [1, 2], [2, 2], [4, 2], [4, 3], [6, 3],
          [6, 2], [4, 2], [2, 2], [2, 1], [1, 1]], 33),
        # Corners in the middle of straight sides, all four of them.
        ([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 2], [2, 2], [1, 2], [0, 2], [0, 1]], 6),
        # A hole that touches the outline in a point.
        ([[0, 0], [4, 0], [4, 4], [0, 4], [0, 2], [1, 3], [2, 2], [1, 1], [0, 2]], 14),
    ],
)  # fmt: skip
@pytest.mark.parametrize("turned", [False, True])
def test_outlines_that_touch_themselves_or_have_straight_corners(outline, area, turned):
    flat = np.array(outline, dtype=float)
    points, loop = np.unique(flat, axis=0, return_inverse=True)
    place = np.column_stack([points, np.zeros(len(points))])
    if turned:
        place = place @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0].T + 7
    mesh = make(place, [loop.tolist()])
    corners, polygon = triangles(mesh)
    assert len(corners) == len(outline) - 2
    assert set(polygon.tolist()) == {0}
    a, b, c = np.moveaxis(mesh.vertices[corners], 1, 0)
    normals = np.cross(b - a, c - a) / 2
    areas = np.linalg.norm(normals, axis=1)
    assert areas.sum() == pytest.approx(area)
    assert np.linalg.norm(normals.sum(axis=0)) == pytest.approx(area)
    assert describe_faults(inspect(mesh)) == []
