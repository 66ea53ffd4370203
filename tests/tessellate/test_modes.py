"""The modes of mesh output against the exact map: rates, counts, closedness, distances."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.interpolate import BSpline

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.brep.evaluate.own_check import check_brep
from ffdcli.errors import CheckError
from ffdcli.triangles import deform_mesh
from support.places import SAMPLES
from support.plain_files import CORNERS

BOX = f"""{CORNERS}\
g bottom
f 4 3 2 1
g top
f 5 6 7 8
g sides
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
TWIST = "edits:\n  - twist: {axis: w, angle: 60}\n  - move: {at: [-1, -1, -1], by: [0.5, 0.3, 1]}\n"
MIRROR = 'edits:\n  - transform: {at: [":", ":", ":"], scale: [-1, 1, 1.5]}\n' + (
    "  - move: {at: [0, 0, -1], by: [0, 0, 1]}\n"
)
MODES = ["exact", "vertices", "uniform", "adaptive"]


@pytest.fixture
def job(job):
    """As the ``job`` of all tests, for a box whose sides have names."""

    def make(lattice, mesh=BOX):
        return job(lattice, mesh=mesh)

    return make


def sample(name):
    mesh = read_mesh(next(SAMPLES.glob(f"{name}.[op][bl][jy]")))
    return mesh, read_lattice(SAMPLES / f"{name}.yaml", mesh)


def exact_image(lattice, points):
    """The deformation by scipy's tensor product, in the box; the frame must be the model's."""
    volume = lattice.volume
    net = volume.net
    rows = [
        BSpline.design_matrix(points[:, a] - volume.frame.origin[a], t, k).toarray()
        for a, (t, k) in enumerate(zip(volume.knots, volume.degrees, strict=True))
    ]
    return np.einsum("pi,pj,pk,ijkd->pd", *rows, net) + volume.frame.origin


def as_trimesh(result):
    return trimesh.Trimesh(result.points, result.triangles, process=False)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("edits", [TWIST, MIRROR], ids=["twist", "mirror"])
def test_every_mode_is_closed_and_faces_out(job, mode, edits):
    mesh, lattice = job("degree: [2, 2, 3]\npoints: [3, 4, 5]\n" + edits)
    tolerance = None if mode == "vertices" else 0.02
    result = deform_mesh(mesh, lattice, mode=mode, tolerance=tolerance)
    body = as_trimesh(result)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume > 0
    assert mode == "vertices" or result.deviation <= 0.02
    assert result.report["watertight"]
    np.testing.assert_allclose(
        result.points, exact_image(lattice, result.rest), atol=1e-13 * mesh.size
    )


@pytest.mark.parametrize("mode", MODES)
def test_bodies_that_touch_along_a_diagonal_stay_closed(job, mode):
    # A box has the corners 5 and 7 at the ends of the diagonal of its top.
    tip = "v 0 3 7\nv 2 0 7\nf 5 7 10\nf 7 5 9\nf 5 10 9\nf 7 9 10\n"
    mesh, lattice = job("degree: [2, 2, 3]\npoints: [3, 4, 5]\n" + TWIST, BOX + tip)
    tolerance = None if mode == "vertices" else 0.02
    result = deform_mesh(mesh, lattice, mode=mode, tolerance=tolerance)
    assert result.report["mesh"]["bodies"] == 2
    assert result.report["watertight"]
    # Whatever touches, every side has its reverse, as often as it occurs.
    sides = np.concatenate([result.triangles[:, [n, (n + 1) % 3]] for n in range(3)])
    there, times = np.unique(sides, axis=0, return_counts=True)
    back, again = np.unique(sides[:, ::-1], axis=0, return_counts=True)
    np.testing.assert_array_equal(np.c_[there, times], np.c_[back, again])


@pytest.mark.parametrize("mode", MODES)
def test_names_within_a_planar_face_are_kept(job, mode):
    top = "f 5 6 7 8\n"
    assert top in BOX
    text = BOX.replace(top, "f 5 6 7\ng corner\nf 5 7 8\n")
    mesh, lattice = job("degree: [2, 2, 3]\npoints: [3, 4, 5]\n" + TWIST, text)
    tolerance = None if mode == "vertices" else 0.02
    result = deform_mesh(mesh, lattice, mode=mode, tolerance=tolerance)
    x, y, z = result.rest[result.triangles].mean(axis=1).T
    beyond = (z > 4 - 1e-9) & (x / 2 < y / 3)
    named = np.zeros(len(result.triangles), dtype=bool)
    named[result.groups["corner"]] = True
    assert beyond.any()
    assert np.array_equal(named, beyond)
    # Without a wish for names the face stays whole.
    whole = deform_mesh(mesh, lattice, tolerance=0.02, keep=())
    assert len(np.unique(whole.owner)) == 6


@pytest.mark.parametrize("mode", ["exact", "adaptive"])
def test_points_of_the_exact_surface_are_within_the_tolerance(job, mode):
    """Other points than the ones that were looked at, and another way to the nearest triangle."""
    mesh, lattice = job("degree: [3, 2, 3]\npoints: [4, 4, 6]\n" + TWIST)
    result = deform_mesh(mesh, lattice, mode=mode, tolerance=0.03)
    box = trimesh.creation.box(extents=[2, 3, 4])
    points = trimesh.sample.sample_surface(box, 400, seed=1)[0] + [1, 1.5, 2]
    points = np.clip(points, *mesh.bounds)
    nearest = trimesh.proximity.closest_point_naive(
        as_trimesh(result), exact_image(lattice, points)
    )
    distance = nearest[1]
    assert 0.2 * 0.03 < distance.max() <= 0.03 * 1.01
    assert result.deviation <= 0.03
    assert distance.max() <= result.deviation * 1.01


def test_uniform_deviation_falls_with_the_square_of_the_edge_length(job):
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [4, 4, 4]\n" + TWIST)
    found = [deform_mesh(mesh, lattice, mode="uniform", levels=n) for n in range(1, 6)]
    assert [len(r.triangles) for r in found] == [12 * 4**n for n in range(1, 6)]
    errors = np.array([result.deviation for result in found])
    rates = np.log2(errors[:-1] / errors[1:])
    # Nearer to 2 with every level: 1.89 and 1.95 here.
    assert abs(rates[-1] - 2) < 0.06
    assert abs(rates[-1] - 2) < 0.6 * abs(rates[-2] - 2)


@pytest.mark.parametrize(
    ("name", "levels"), [("bracket", 1), ("handle", 2), ("bottle", 2), ("creature", 1)]
)
def test_adaptive_needs_half_of_uniform_at_most(name, levels):
    mesh, lattice = sample(name)
    uniform = deform_mesh(mesh, lattice, mode="uniform", levels=levels)
    adaptive = deform_mesh(mesh, lattice, mode="adaptive", tolerance=uniform.deviation)
    assert adaptive.deviation <= uniform.deviation
    assert len(adaptive.triangles) <= len(uniform.triangles) / 2


@pytest.mark.sweep
@pytest.mark.parametrize("name", ["bracket", "handle", "bottle", "creature"])
def test_adaptive_needs_half_of_uniform_at_every_level(name):
    mesh, lattice = sample(name)
    for levels in (1, 2, 3):
        uniform = deform_mesh(mesh, lattice, mode="uniform", levels=levels)
        adaptive = deform_mesh(mesh, lattice, mode="adaptive", tolerance=uniform.deviation)
        assert len(adaptive.triangles) <= len(uniform.triangles) / 2


def test_uniform_stops_at_the_first_level_within_the_tolerance(job):
    mesh, lattice = job("degree: [2, 2, 2]\npoints: [3, 3, 3]\n" + TWIST)
    levels = [deform_mesh(mesh, lattice, mode="uniform", levels=n).deviation for n in range(4)]
    result = deform_mesh(mesh, lattice, mode="uniform", tolerance=(levels[1] + levels[2]) / 2)
    assert len(result.triangles) == 12 * 4**2
    assert result.deviation == pytest.approx(levels[2])


def test_undeformed_faces_keep_their_corners_only(job):
    """Faces at rest, and flat ones, need no vertex beyond those of their outlines."""
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [7, 7, 7]\n")
    for mode in MODES:
        result = deform_mesh(mesh, lattice, mode=mode)
        assert len(result.triangles) == 12
        assert result.deviation <= 1e-14 * mesh.size


@pytest.mark.parametrize("name", ["bracket", "bottle"])
def test_exact_faces_with_holes_and_neighbours_are_closed(name):
    mesh, lattice = sample(name)
    exact = deform(mesh, lattice, check=False)
    result = exact.tessellate(2e-3 * mesh.size)
    body = as_trimesh(result)
    assert body.is_watertight
    assert body.volume == pytest.approx(check_brep(exact.brep).solid_volumes.sum(), rel=0.01)
    assert set(np.unique(result.owner)) == set(range(exact.brep.face_count))
    assert result.deviation <= 2e-3 * mesh.size


def test_a_wave_between_the_corners_is_seen(job):
    """Ends, middle and quarters of an edge stay put; only between them it moves."""
    moves = "".join(
        f'  - move: {{at: [{i}, ":", ":"], by: [0, 0, {(-1) ** i}]}}\n' for i in range(1, 32)
    )
    mesh, lattice = job("degree: [2, 1, 1]\npoints: [34, 2, 2]\nedits:\n" + moves)
    result = deform_mesh(mesh, lattice, mode="vertices")
    assert result.deviation > 0.3


def test_too_fine_a_tolerance_is_refused_at_once(job):
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [4, 4, 4]\n" + TWIST)
    for mode in ("exact", "uniform", "adaptive"):
        with pytest.raises(CheckError, match="needs more than 4000000 triangles"):
            deform_mesh(mesh, lattice, mode=mode, tolerance=1e-14)


def test_open_meshes_stay_open(job):
    mesh, lattice = job("points: [4, 4, 4]\n" + TWIST, BOX.replace("f 5 6 7 8\n", ""))
    for mode in MODES:
        tolerance = None if mode == "vertices" else 0.05
        result = deform_mesh(mesh, lattice, mode=mode, tolerance=tolerance)
        rim = as_trimesh(result)
        assert not rim.is_watertight
        assert not result.report["watertight"]
        assert any("the mesh is open" in text for text in result.report["warnings"])
        ends, uses = np.unique(np.sort(rim.edges, axis=1), axis=0, return_counts=True)
        lone = ends[uses == 1]
        # What is open is the rim of the missing top, nothing else.
        assert len(lone)
        assert (result.rest[lone, 2] == 4).all()
