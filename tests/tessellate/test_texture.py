"""Texture coordinates of all mesh modes: linear on the mesh's own triangles, seams respected."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.mesh import triangles
from ffdcli.mesh.charts import find_charts
from ffdcli.triangles import deform_mesh
from support.jobs import read_job
from support.places import SAMPLES

MODES = ["exact", "vertices", "uniform", "adaptive"]
TWIST = "edits:\n  - twist: {axis: w, angle: 50}\n  - move: {at: [-1, 1, -1], by: [0.4, 0.2, 1]}\n"
MIRROR = 'edits:\n  - transform: {at: [":", ":", ":"], scale: [-1, 1, 1.5]}\n' + (
    "  - move: {at: [0, 0, -1], by: [0, 0, 1]}\n"
)
PART = "box: {min: [-1, -1, 1.1], max: [3, 4, 4.5]}\ndegree: [2, 2, 3]\npoints: [4, 3, 6]\n" + (
    "edits:\n  - move: {at: [1, 1, 5], by: [0.3, 0.4, 0.5]}\n"
)


def grid_box(cells, uv_of):
    """OBJ text of a 2 x 3 x 4 box, sides of triangles on a jittered grid, and its texture.

    ``uv_of(side, points)`` gives (n, 2) places for points of one of the six sides.
    """
    box = trimesh.creation.box(extents=[2, 3, 4]).apply_translation([1, 1.5, 2])
    for _ in range(cells):
        box = box.subdivide()
    points, faces = np.array(box.vertices), np.array(box.faces)
    # Vertices slide within the sides that they lie inside of: the grid is irregular, sides flat.
    inner = (points > 1e-9) & (points < np.array([2, 3, 4]) - 1e-9)
    points += inner * np.random.default_rng(0).uniform(-0.08, 0.08, points.shape)
    middle = points[faces].mean(axis=1)
    walls = np.column_stack([middle < 1e-6, middle > np.array([2, 3, 4]) - 1e-6])
    side = np.argmax(walls, axis=1)
    uv = np.concatenate([uv_of(s, points[f]) for s, f in zip(side.tolist(), faces, strict=True)])
    lines = ["v {!r} {!r} {!r}".format(*row) for row in points.tolist()]
    lines += ["vt {!r} {!r}".format(*row) for row in uv.tolist()]
    for n, row in enumerate((faces + 1).tolist()):
        lines.append("f " + " ".join(f"{v}/{3 * n + k + 1}" for k, v in enumerate(row)))
    return "\n".join([*lines, ""])


def run(mesh, lattice, mode, tolerance=0.02):
    allowed = None if mode == "vertices" else tolerance
    return deform_mesh(mesh, lattice, mode=mode, tolerance=allowed)


def affine_map(side):
    """An affine map of space for each side, none like another."""
    return np.random.default_rng(side).uniform(-0.3, 0.3, (4, 2))


def affine_uv(side, points):
    return np.column_stack([np.ones(len(points)), points]) @ affine_map(side)


def side_of(points):
    walls = np.concatenate([points < 1e-9, points > np.array([2, 3, 4]) - 1e-9], axis=2)
    return np.argmax(walls.all(axis=1), axis=1)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("edits", [TWIST, MIRROR], ids=["twist", "mirror"])
def test_affine_texture_stays_affine(tmp_path, mode, edits):
    """Every side has one affine map: so must its triangles have, and at seams both sides theirs."""
    lattice = "degree: [2, 2, 3]\npoints: [3, 4, 5]\n" + edits
    result = run(*read_job(tmp_path, lattice, mesh=grid_box(1, affine_uv)), mode)
    corners = result.rest[result.triangles]
    for side, places, uv in zip(side_of(corners).tolist(), corners, result.uv, strict=True):
        np.testing.assert_allclose(uv, affine_uv(side, places), atol=1e-12)
    assert not any("texture" in text for text in result.warnings)


@pytest.mark.parametrize("mode", ["exact", "adaptive"])
def test_one_affine_map_costs_no_triangles(tmp_path, mode):
    """Where each side has one map of its own, faces and triangles are as without a texture."""
    lattice = "degree: [2, 2, 3]\npoints: [3, 4, 5]\n" + TWIST
    mesh, settled = read_job(tmp_path, lattice, mesh=grid_box(1, affine_uv))
    bare = deform_mesh(mesh, settled, mode=mode, tolerance=0.02, keep=())
    assert bare.uv is None
    full = run(mesh, settled, mode)
    assert np.array_equal(full.triangles, bare.triangles)
    assert np.array_equal(full.points, bare.points)


def wavy_uv(side, points):
    return np.column_stack(
        [np.sin(points @ [1.0, 0.7, 0.4] + side), np.cos(points @ [0.3, 1, 0.8])]
    )


def random_uv(side, points):
    """Other places on every polygon, whatever its neighbours have."""
    seed = np.abs(np.round(1e6 * points.sum(axis=0))).astype(np.int64)
    return np.random.default_rng([side, *seed]).uniform(0, 1, (len(points), 2))


def own_places(mesh, points, near):
    """Texture coordinates of points on the mesh, by search: of the triangle that each is in.

    ``near`` (n, 3): a point just inside the piece asked for, which tells the triangle.
    """
    corner, _ = triangles(mesh)
    body = trimesh.Trimesh(mesh.vertices, corner, process=False)
    _, away, found = trimesh.proximity.closest_point_naive(body, near)
    assert away.max() < 1e-9
    assert np.array_equal(mesh.corners.reshape(-1, 3), corner)
    share = trimesh.triangles.points_to_barycentric(body.triangles[found], points)
    assert share.min() > -1e-6
    return np.einsum("nk,nkj->nj", share, mesh.uv.reshape(-1, 3, 2)[found])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("lattice", [TWIST, PART], ids=["whole", "part"])
@pytest.mark.parametrize("uv_of", [wavy_uv, random_uv], ids=["wavy", "seams everywhere"])
def test_any_texture_is_followed(tmp_path, mode, lattice, uv_of):
    """At corners and in the middle of every new triangle, by another way to find the place."""
    mesh, settled = read_job(tmp_path, lattice, mesh=grid_box(1, uv_of))
    result = run(mesh, settled, mode, 0.15)
    corners = result.rest[result.triangles]
    middle = corners.mean(axis=1)
    np.testing.assert_allclose(result.uv.mean(axis=1), own_places(mesh, middle, middle), atol=1e-9)
    for n in range(3):
        np.testing.assert_allclose(
            result.uv[:, n], own_places(mesh, corners[:, n], middle), atol=1e-9
        )
    assert trimesh.Trimesh(result.points, result.triangles, process=False).is_watertight


@pytest.mark.parametrize("mode", MODES)
def test_a_seam_within_a_planar_face(tmp_path, mode):
    """The two triangles of a square have maps of their own; nothing reaches over the diagonal."""
    text = (
        "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 5 5\nvt 5 6\nvt 7 6\n"
        "f 1/1 2/2 3/3\nf 1/4 3/5 4/6\n"
    )
    lattice = "box: {min: [-1, -1, -1], max: [5, 5, 1]}\npoints: [5, 4, 4]\nedits:\n" + (
        "  - move: {at: [2, 2, 1], by: [0, 0, 2]}\n  - move: {at: [2, 2, 2], by: [0, 0, 2]}\n"
    )
    result = run(*read_job(tmp_path, lattice, mesh=text), mode)
    x, y = (result.rest[result.triangles][:, :, axis] for axis in (0, 1))
    below = (x - y).mean(axis=1) > 0
    assert ((x - y >= -1e-12) == below[:, None])[np.abs(x - y) > 1e-12].all()
    first = np.stack([x, y], axis=2) / 4
    second = np.stack([5 + (y - x) / 2, 5 + y / 4], axis=2)
    np.testing.assert_allclose(result.uv, np.where(below[:, None, None], first, second), atol=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_a_polygon_whose_texture_is_not_affine(tmp_path, mode):
    """A flat quad is two triangles along its shorter diagonal, and so is its texture.

    Here that diagonal, x = 0, is not the one of the Delaunay triangulation.
    """
    points = np.array([[-0.2, 0.9], [0, -1], [0.3, -1.05], [0, 1]])
    places = np.array([[0.0, 0.0], [1, 0], [0, 1], [1, 3]])
    text = "".join("v {!r} {!r} 0\n".format(*row) for row in points.tolist())
    text += "".join("vt {!r} {!r}\n".format(*row) for row in places.tolist())
    lattice = "box: {min: [-1, -2, -1], max: [1, 2, 1]}\npoints: [5, 5, 4]\nedits:\n" + (
        "  - move: {at: [2, 2, ':'], by: [0, 0, 1]}\n  - move: {at: [1, 1, ':'], by: [0, 0, -1]}\n"
    )
    result = run(*read_job(tmp_path, lattice, mesh=text + "f 1/1 2/2 3/3 4/4\n"), mode)
    corners = result.rest[result.triangles][:, :, :2]
    left = corners[:, :, 0].mean(axis=1) < 0
    for half, own in ((left, [0, 1, 3]), (~left, [1, 2, 3])):
        assert half.any()
        fit = np.linalg.solve(np.column_stack([np.ones(3), points[own]]), places[own])
        rows = np.concatenate([np.ones((half.sum(), 3, 1)), corners[half]], axis=2)
        np.testing.assert_allclose(result.uv[half], rows @ fit, atol=1e-12)


def test_neighbours_agree_to_the_last_bit(tmp_path):
    """A texture without seams has none afterwards: one place for each vertex."""

    def unrolled(_, points):
        return np.column_stack([points @ [0.31, 0.17, 0.05], np.sin(points[:, 2])])

    for mode in MODES:
        mesh, lattice = read_job(tmp_path, PART, mesh=grid_box(1, unrolled))
        result = run(mesh, lattice, mode)
        rows = np.column_stack([result.triangles.ravel(), result.uv.reshape(-1, 2)])
        assert len(np.unique(rows, axis=0)) == len(np.unique(result.triangles))


def test_polygons_without_texture(tmp_path):
    text = grid_box(0, affine_uv).splitlines()
    faces = [n for n, line in enumerate(text) if line.startswith("f")]
    for n in faces[::2]:
        text[n] = "f " + " ".join(token.partition("/")[0] for token in text[n].split()[1:])
    mesh, lattice = read_job(tmp_path, TWIST, mesh="\n".join([*text, ""]))
    for mode in MODES:
        result = run(mesh, lattice, mode)
        bare = np.isnan(result.uv).all(axis=(1, 2))
        assert np.array_equal(bare, np.isnan(result.uv).any(axis=(1, 2)))
        assert bare.any()
        assert not bare.all()
        corners = result.rest[result.triangles]
        side = side_of(corners)
        for s, places, uv in zip(side[~bare], corners[~bare], result.uv[~bare], strict=True):
            np.testing.assert_allclose(uv, affine_uv(int(s), places), atol=1e-12)


def test_a_result_made_without_regard_to_seams_says_so(tmp_path):
    mesh, lattice = read_job(tmp_path, TWIST, mesh=grid_box(0, affine_uv))
    result = deform(mesh, lattice).tessellate(0.05)
    assert result.uv is None
    assert any("texture coordinates are left out" in text for text in result.warnings)


def test_no_texture_no_word(tmp_path):
    mesh = read_mesh(SAMPLES / "bottle.obj")
    lattice = read_lattice(SAMPLES / "bottle.yaml", mesh)
    result = deform_mesh(mesh, lattice, mode="vertices")
    assert mesh.uv is None
    assert result.uv is None
    assert not any("texture" in text for text in result.write(tmp_path / "b.stl").warnings)


def test_charts_of_a_drifting_map():
    """Each strip agrees with the next but for less than the slack; the whole is no affine map."""
    count = 400
    x = np.arange(count + 1) / count
    points = np.concatenate([np.column_stack([x, y + 0 * x, 0 * x]) for y in (0, 1)])
    low, high = np.arange(count), count + 1 + np.arange(count)
    faces = np.concatenate(
        [np.stack([low, low + 1, high + 1], 1), np.stack([low, high + 1, high], 1)]
    )
    straight, bent = points[:, :2], np.column_stack([points[:, 0] ** 2, points[:, 1]])
    face = np.zeros(len(faces), dtype=np.int64)
    assert find_charts(points, faces, straight[faces], face).max() == 0
    # Neighbours differ by 2 / count^2 = 1.25e-5 at most; with a quarter of that they all agree.
    soft = 0.25 * bent + 0.75 * straight
    assert find_charts(points, faces, soft[faces], face).max() > 0
