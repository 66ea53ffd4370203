"""Diagonals: no triangle without area where corners lie in a row, none on an edge of others."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.errors import MeshError
from ffdcli.mesh import describe_faults, inspect, read_mesh, require_usable, triangles
from ffdcli.mesh.flip import are_proper
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS, make

OUTLINE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
# A tetrahedron whose edges 0 1 and 2 3 have a vertex in the middle: four quads, two along each.
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.9, 0], [0.4, 0.3, 0.8]])
FOUR = [[0, 2, 1, 4], [0, 4, 1, 3], [1, 2, 5, 3], [2, 0, 3, 5]]


def turned(seed):
    matrix = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


def prism():
    count = len(OUTLINE)
    vertices = [[x, y, z] for z in (0, 1) for x, y in OUTLINE]
    around = [(n, (n + 1) % count) for n in range(count)]
    walls = [[a, b, b + count, a + count] for a, b in around]
    return vertices, [list(range(count))[::-1], list(range(count, 2 * count)), *walls]


def with_rows(vertices, polygons, inner):
    """Every edge with vertices in a row on it, which its two polygons alone have."""
    points, rows, out = [np.asarray(v, dtype=float) for v in vertices], {}, []
    for loop in polygons:
        new = []
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
            low, high = min(a, b), max(a, b)
            if (low, high) not in rows:
                steps = np.arange(1, inner + 1) / (inner + 1)
                rows[low, high] = list(range(len(points), len(points) + inner))
                points += [points[low] * (1 - t) + points[high] * t for t in steps]
            new += [a, *rows[low, high][:: 1 if a == low else -1]]
        out.append(new)
    return np.array(points), out


def volume_of(mesh):
    corners, _ = triangles(mesh)
    a, b, c = np.moveaxis(mesh.vertices[corners] - mesh.vertices[0], 1, 0)
    return np.einsum("ti,ti->", a, np.cross(b, c)) / 6


@pytest.fixture
def read(tmp_path):
    def made(vertices, polygons):
        (tmp_path / "a.obj").write_text(obj(np.asarray(vertices).tolist(), polygons))
        return read_mesh(tmp_path / "a.obj")

    return made


@pytest.mark.parametrize("digits", [6, 5, 3])
@pytest.mark.parametrize("inner", [1, 2, 3, 5])
def test_rounded_polygons_with_corners_in_a_row_stay_sound(read, digits, inner):
    """Rounding makes them bent; the triangles they are split into are no fault of the file."""
    vertices, polygons = with_rows(*prism(), inner)
    split = 0
    for seed in range(6):
        mesh = read(np.round(vertices @ turned(seed).T, digits), polygons)
        split += mesh.polygon_count > len(polygons)
        soundness = inspect(mesh)
        assert not describe_faults(soundness)
        assert soundness.closed
        assert soundness.bodies == 1
        assert volume_of(mesh) == pytest.approx(3, abs=20 * 10.0**-digits)
    assert split >= 5


@pytest.mark.parametrize("inner", [1, 2, 4])
def test_flat_polygons_have_no_triangles_along_a_row(inner):
    vertices, polygons = with_rows(*prism(), inner)
    for seed in range(4):
        mesh = make(vertices @ turned(seed).T, polygons)
        corners, _ = triangles(mesh)
        points = mesh.vertices[corners]
        sides = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
        turns = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        altitude = np.linalg.norm(turns, axis=1) / sides.max(axis=1)
        assert altitude.min() > 0.05 / (inner + 1)


@pytest.mark.parametrize("stretch", [[1, 1, 1], [0.3, 1, 1], [1, 0.2, 0.2], [0.2, 0.2, 1]])
@pytest.mark.parametrize("height", [-0.2, -0.05, 0.05, 0.2])
def test_bent_quads_that_meet_along_two_edges_are_split_apart(read, stretch, height):
    middle = (TETRAHEDRON[[0, 2]] + TETRAHEDRON[[1, 3]]) / 2
    middle += height * np.array([[0, 1, 0.5], [1, 0, 1]])
    mesh = read(np.concatenate([TETRAHEDRON, middle]) * stretch, FOUR)
    assert mesh.polygon_count == 8
    soundness = inspect(mesh)
    assert soundness.closed
    for fault in ("duplicates", "nonmanifold_edges", "degenerate"):
        assert not getattr(soundness, fault).count


def test_a_bent_quad_is_not_split_along_an_edge_of_others(read):
    """A roof of two triangles on 0 1, the shorter diagonal of the bent quad below them."""
    vertices = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0.4], [0.5, -1, 0.4]]
    mesh = read(vertices, [[0, 2, 1, 3], [0, 1, 2], [1, 0, 3]])
    assert all({2, 3} < set(loop) for loop in mesh.corners[:6].reshape(2, 3).tolist())
    assert not inspect(mesh).nonmanifold_edges.count


def test_where_no_other_diagonal_lies_inside_the_fault_is_named(read):
    """Quads with a reflex corner have one diagonal only: both here have the same one."""
    vertices = [[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0.2], [0, 2, 0]]
    mesh = read(vertices, [[0, 1, 2, 3], [2, 1, 0, 3]])
    with pytest.raises(MeshError, match="2 polygons lie on the same vertices as others"):
        require_usable(mesh, inspect(mesh))


def test_quads_are_split_off_the_row(read):
    """Three corners in a row by rounding only, the far corner further off than the row is long."""
    end = np.array([0.2, 0.2, 0.2])
    quad = np.array([0 * end, end / 3, end, [0.3, -3, 5]])
    for seed in range(20):
        mesh = make(quad @ turned(seed).T, [[0, 1, 2, 3]])
        corners, _ = triangles(mesh)
        assert sorted(map(sorted, corners.tolist())) == [[0, 1, 3], [1, 2, 3]]


def test_what_is_proper():
    square = CORNERS[QUADS[1]]
    normal = np.array([0, 0, 3.0])
    corners = np.stack([square[:3], square[2::-1], square[[0, 1, 1]], square[:3]])
    corners[3, 2] = corners[3, :2].mean(axis=0) + [0, 1e-17, 0]
    assert are_proper(corners, normal).tolist() == [True, False, False, False]
    assert not are_proper(corners, 0 * normal).any()
