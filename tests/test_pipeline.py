"""Whole runs through the Python interface: counts, rest, affine, partial, mirrored, far, small."""

import re

import numpy as np
import pytest

from ffdcli import deform, deform_mesh, injective_scale, prepare, read_lattice
from ffdcli.errors import CheckError, FileError, LatticeError
from ffdcli.surface import refine
from ffdcli.verify.file import verify_file
from support.commands import ffd
from support.jobs import CUBE, CUBE_FACES, EDITS, turn, written


def test_a_lattice_read_without_a_mesh_deforms_nothing(job, tmp_path):
    mesh, settled = job("")
    lattice = read_lattice(tmp_path / "lattice.yaml")
    assert lattice.definitions[0].spec == settled.member.spec
    for use in (
        lambda: deform(mesh, lattice),
        lambda: prepare(mesh, lattice),
        lambda: prepare(mesh, settled).deform(lattice),
        lambda: deform_mesh(mesh, lattice, mode="vertices"),
        lambda: injective_scale(mesh, lattice),
        lambda: lattice.drag([[0, 0, 0]], [[0, 0, 1]]),
    ):
        with pytest.raises(LatticeError, match="needs a mesh before it can be used") as caught:
            use()
        assert "read_lattice(path, mesh)" in caught.value.hint


def test_the_papers_cube(job, tmp_path):
    mesh, lattice = job("degree: [2, 2, 2]\npoints: [4, 4, 4]\n" + EDITS)
    bezier = deform(mesh, lattice, patches="bezier")
    report = bezier.report
    counts = [report[name] for name in ("sub_polygons", "patches", "faces", "edges", "vertices")]
    assert counts == [36, 24, 24, 48, 26]
    assert report["degrees"] == {"2x2": 24}
    merged = deform(mesh, lattice)
    report = merged.report
    assert [report[name] for name in ("faces", "edges", "vertices", "solids")] == [6, 12, 8, 1]
    assert report["watertight"]
    volumes = [
        written(result, tmp_path / "cube.step", mesh, lattice).volume for result in (bezier, merged)
    ]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-12)


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_rest_lattice_gives_the_input_back(job, far):
    points = CUBE @ turn([0.3, 0.5, 0.7]).T + far
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [6, 5, 7]\n", points)
    result = deform(mesh, lattice)
    assert set(result.report["degrees"]) == {"plane"}
    assert all(batch.degree == 1 for batch in result.brep.curves)
    local = np.abs(result.brep.points[:, None] - mesh.vertices[None]).max(axis=2).min(axis=0)
    assert local.max() <= max(1e-14 * mesh.size, np.spacing(far))
    planes = result.brep.planes
    normal = np.cross(planes.x_axis, planes.y_axis)
    for face, surface in enumerate(result.brep.face_surface):
        loop = result.brep.face_loops[face]
        first, last = result.brep.loop_coedges[loop], result.brep.loop_coedges[loop + 1]
        corner = result.brep.points[result.brep.edges[result.brep.coedge_edge[first:last]]]
        row = np.flatnonzero(planes.surfaces == surface)[0]
        height = (corner - planes.origin[row]) @ normal[row]
        assert np.abs(height).max() <= max(1e-14 * mesh.size, 4 * np.spacing(far))


def test_affine_edits_give_planes(job, tmp_path):
    edit = 'edits: [{transform: {at: [":", ":", ":"], scale: [1, 2, 0.5], '
    edit += "rotate: {axis: w, angle: 30}, translate: [3, 0, 1]}}]\n"
    mesh, lattice = job("degree: [3, 2, 3]\npoints: [5, 5, 5]\n" + edit)
    result = deform(mesh, lattice)
    assert result.report["degrees"] == {"plane": 6}
    assert written(result, tmp_path / "a.step", mesh, lattice).volume == pytest.approx(1, rel=1e-12)


def test_mirroring_edits_keep_the_solid_outside_in(job, tmp_path):
    edit = 'edits:\n  - transform: {at: [":", ":", ":"], scale: [-1, 1, 1]}\n'
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [4, 4, 4]\n" + edit + EDITS[8:])
    result = deform(mesh, lattice)
    assert result.brep.face_reversed.all()
    assert written(result, tmp_path / "a.step", mesh, lattice).volume > 0


PARTIAL = """degree: [3, 3, 3]
points: [8, 7, 7]
box: {min: [-1, -0.6, -0.6], max: [0.7, 0.6, 0.6]}
"""


@pytest.fixture
def bar():
    return (CUBE - 0.5) * [4, 1, 1] + [0.1, 0, 0]


def test_partial_lattice_leaves_the_rest_to_the_last_bit(job, tmp_path, bar):
    edits = 'edits:\n  - move: {at: [4, 3, ":"], by: [0.05, 0.3, 0.2]}\n'
    mesh, lattice = job(PARTIAL + edits, bar)
    result = deform(mesh, lattice)
    report = result.report
    assert report["solids"] == 1
    assert report["watertight"]
    # The two ends, and a plane for both parts of each side.
    assert report["degrees"] == {"3x3": 4, "plane": 6}
    points = {tuple(point) for point in result.brep.points.tolist()}
    outside = [tuple(p) for p in bar.tolist() if not -1 <= p[0] <= 0.7]
    assert len(outside) == 8
    assert points.issuperset(outside)
    written(result, tmp_path / "bar.step", mesh, lattice)
    content = "".join((tmp_path / "bar.step").read_text().split())
    numbers = re.findall(r"CARTESIAN_POINT\('',\(([^()]*)\)\)", content)
    points = {tuple(map(float, triple.split(","))) for triple in numbers}
    assert points.issuperset(outside)


def test_partial_lattice_joins_smoothly(job, bar):
    """Default border: at the seam the surfaces' tangent planes are those of the flat part."""
    edits = 'edits:\n  - move: {at: [3, 3, ":"], by: [0.05, 0.3, 0.2]}\n'
    mesh, lattice = job(PARTIAL + edits, bar)
    result = deform(mesh, lattice)
    seam = 0
    for batch in result.brep.surfaces:
        for poles in batch.poles:
            for side in (poles, poles[::-1], poles.swapaxes(0, 1), poles.swapaxes(0, 1)[::-1]):
                if np.abs(np.abs(side[0, :, 0] + 0.15) - 0.85).max() <= 1e-15:
                    seam += 1
                    flat = np.flatnonzero(np.ptp(side[0], axis=0) <= 1e-15)
                    across = [axis for axis in flat if axis != 0]
                    assert len(across) == 1
                    assert np.abs(side[1] - side[0])[:, across].max() <= 1e-15
    assert seam == 8


def test_editing_a_locked_layer_is_refused_by_name(job, bar):
    edits = "edits:\n  - move: {at: [0, 3, 3], by: [0, 0.3, 0]}\n"
    with pytest.raises(LatticeError, match=r"u_min") as caught:
        job(PARTIAL + edits, bar)
    assert "[0, 3, 3]" in str(caught.value)
    assert caught.value.line is not None


def test_mesh_partly_in_an_inner_box(job, tmp_path):
    """A lattice box wholly inside a solid, and one that only a corner reaches into."""
    points = (CUBE - 0.5) @ turn([0.3, 0.5, 0.7]).T
    lattice = "degree: [2, 2, 2]\npoints: [7, 7, 7]\nbox: {min: [0.1, 0.1, 0.1], max: [2, 2, 2]}\n"
    edits = "edits:\n  - move: {at: [3, 3, 3], by: [0.1, 0.1, -0.1]}\n"
    mesh, settled = job(lattice + edits, points)
    result = deform(mesh, settled)
    assert result.report["solids"] == 1
    written(result, tmp_path / "a.step", mesh, settled)


@pytest.mark.parametrize("patches", ["merged", "bezier"])
@pytest.mark.parametrize("degree", [(1, 1, 1), (1, 2, 3), (2, 2, 2), (3, 3, 3), (4, 3, 2)])
def test_turned_cube_in_general_position(job, tmp_path, degree, patches):
    points = CUBE @ turn([0.3, 0.5, 0.7]).T
    mesh, lattice = job(f"degree: {list(degree)}\npoints: [6, 5, 7]\n" + EDITS, points)
    result = deform(mesh, lattice, patches=patches)
    assert result.report["plane_deviation"] < 1e-14
    verdict = written(result, tmp_path / "a.step", mesh, lattice)
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-4, 1e6])
def test_models_of_all_sizes(job, tmp_path, scale):
    edits = "edits:\n  - twist: {axis: w, angle: 30}\n  - taper: {axis: w, factor: 0.6}\n"
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + edits, CUBE * scale)
    verdict = written(deform(mesh, lattice), tmp_path / "a.step", mesh, lattice)
    assert verdict.max_deviation < 1e-12 * mesh.size


def test_a_box_turned_by_rounding_stays_a_box(job):
    """Slopes of 1e-16 are no slopes."""
    quarter = turn([np.pi / 2, np.pi / 2, np.pi / 2])
    assert 0 < np.abs(quarter[quarter != 0]).min() < 1e-15
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [6, 6, 6]\n" + EDITS, CUBE @ quarter.T)
    report = deform(mesh, lattice).report
    assert report["degrees"] == {"3x3": 6}
    assert report["plane_deviation"] < 1e-14


def test_plan_serves_many_nets(job):
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + EDITS)
    plan = prepare(mesh, lattice)
    assert plan.deform(lattice.scaled(0)).report["degrees"] == {"plane": 6}
    for share in (0.25, 1.0):
        kept = plan.deform(lattice.scaled(share)).brep
        fresh = deform(mesh, lattice.scaled(share)).brep
        for a, b in zip(kept.surfaces, fresh.surfaces, strict=True):
            assert np.array_equal(a.poles, b.poles)


def test_plan_refuses_other_knots(job):
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [5, 5, 5]\n")
    plan = prepare(mesh, lattice)
    _, other = job("degree: [3, 3, 3]\npoints: [6, 5, 5]\n")
    with pytest.raises(LatticeError, match="other degrees, knots"):
        plan.deform(other)


def test_a_collapsed_solid_is_refused(job):
    """A lattice that flattens the model leaves no solid; nothing may be written."""
    edit = 'edits:\n  - transform: {at: [":", ":", ":"], scale: [1, 1, 0]}\n'
    mesh, lattice = job("degree: [2, 2, 2]\npoints: [4, 4, 4]\n" + edit)
    with pytest.raises(CheckError, match="nothing was written"):
        deform(mesh, lattice)


def test_open_mesh_gives_an_open_shell(job, tmp_path):
    mesh, lattice = job("degree: [2, 2, 2]\npoints: [4, 4, 4]\n" + EDITS, faces=CUBE_FACES[2:])
    result = deform(mesh, lattice)
    report = result.report
    assert (report["solids"], report["watertight"], report["faces"]) == (0, False, 5)
    assert any("open" in warning for warning in report["warnings"])
    result.write(tmp_path / "open.step")
    assert verify_file(tmp_path / "open.step", mesh, lattice).max_deviation < 1e-12


def test_cavity_and_two_bodies(job, tmp_path):
    inner, other = CUBE / 2 + 0.25, CUBE + [3, 0, 0]
    faces = np.concatenate([CUBE_FACES[:, ::-1] + 8, CUBE_FACES, CUBE_FACES + 16])
    points = np.concatenate([CUBE, inner, other])
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + EDITS, points, faces)
    result = deform(mesh, lattice)
    assert result.report["solids"] == 2
    assert sorted(np.bincount(result.brep.shell_solid).tolist()) == [1, 2]
    written(result, tmp_path / "a.step", mesh, lattice)


@pytest.mark.parametrize("name", ["out.xyz", "out", "missing/out.step"])
def test_outputs_that_cannot_be_written(job, tmp_path, name):
    mesh, lattice = job("degree: [2, 2, 2]\npoints: [4, 4, 4]\n")
    with pytest.raises(FileError):
        deform(mesh, lattice).write(tmp_path / name)


TETRAHEDRON = np.array(
    [[0.03, 0.01, 0.0], [1.0, 0.13, 0.21], [0.17, 0.92, 0.34], [0.29, 0.41, 1.0]]
)
TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def test_slabs_thinner_than_kernels_can_cut(job):
    """A model so small that its strips cannot be cut on: it ends, and it is right."""
    lattice = "degree: [2, 2, 2]\npoints: [12, 12, 12]\nedits:\n  - twist: {axis: w, angle: 20}\n"
    mesh, settled = job(lattice, TETRAHEDRON * 1e-5, TETRAHEDRON_FACES)
    assert deform(mesh, settled).report["solids"] == 1


def test_mirroring_in_a_turned_box(job, tmp_path):
    """The vertices lie on the box but for rounding; their sense is that of the solid."""
    axes = turn([0.4, 1.1, 2.3])
    points = (CUBE - 0.5) * 2 @ axes
    box = f"{{center: [0, 0, 0], size: [2, 2, 2], axes: {axes.tolist()}}}"
    edits = 'edits:\n  - transform: {at: [":", ":", ":"], scale: [-1, 1, 1]}\n'
    edits += "  - move: {at: [2, 2, 2], by: [0.1, 0, 0]}\n"
    lattice = f"degree: [3, 3, 3]\npoints: [5, 5, 5]\nbox: {box}\n" + edits
    mesh, settled = job(lattice, points)
    result = deform(mesh, settled)
    assert result.brep.face_reversed.all()
    assert written(result, tmp_path / "a.step", mesh, settled).volume > 0


def prism(place):
    """A square prism along x with a ring of vertices at ``place``."""
    ring = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 200.0
    points = np.concatenate([np.insert(ring, 0, x, axis=1) for x in (0.0, place, 1000.0)])
    sides = [
        [4 * k + i, 4 * k + j, 4 * k + 4 + j, 4 * k + 4 + i]
        for k in range(2)
        for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))
    ]
    return points, [*sides, [3, 2, 1, 0], [8, 9, 10, 11]]


def test_vertices_just_beside_a_crease(job, tmp_path):
    """Within epsilon of a C0 plane: the two polynomials part there, and the tolerance says so."""
    points, faces = prism(500 + 8e-7)
    lattice = "degree: [1, 1, 1]\npoints: [3, 3, 3]\n"
    edits = 'edits:\n  - move: {at: [1, ":", ":"], by: [30, 80, 50]}\n'
    mesh, settled = job(lattice + edits, points, faces)
    result = deform(mesh, settled)
    assert 0 < result.report["plane_deviation"] < 1e-8 * mesh.size
    written(result, tmp_path / "a.step", mesh, settled)


@pytest.mark.parametrize(("size", "angle"), [(100, 1e-12), (100, 1e-8), (1, 1e-12), (1, 1e-6)])
def test_slopes_next_to_nothing_beside_a_crease(job, tmp_path, size, angle):
    """Edges that all but lie in a C0 plane: their pcurves are all but parallel to a side."""
    mesh, lattice = tilted_ball(job, size, angle)
    result = deform(mesh, lattice)
    assert result.report["plane_deviation"] < 1e-8 * mesh.size
    written(result, tmp_path / "ball.step", mesh, lattice)


def test_edges_too_short_for_step_beside_a_crease_are_kept_in_brep(job, tmp_path):
    """Vertices beyond epsilon from a C0 plane, but nearer than readers of STEP can tell."""
    mesh, lattice = tilted_ball(job, 1, 3e-8)
    result = deform(mesh, lattice)
    with pytest.raises(CheckError, match="44 edges are shorter than 1e-07"):
        result.write(tmp_path / "ball.step")
    assert result.report["plane_deviation"] < 4 * result.report["epsilon"]
    written(result, tmp_path / "ball.brep", mesh, lattice)


def tilted_ball(job, size, angle):
    """A ball with vertices on the planes of its lattice's knots, but for a tiny turn."""
    import trimesh

    ball = trimesh.creation.icosphere(1)
    points = size * np.array(ball.vertices) @ turn([angle, 0, 0]).T
    low, high = [-1.2 * size] * 3, [1.2 * size] * 3
    lattice = f"degree: [1, 1, 1]\npoints: [3, 3, 3]\nbox: {{min: {low}, max: {high}}}\n"
    return job(lattice + "edits:\n  - twist: {axis: u, angle: 20}\n", points, ball.faces)


def test_vertices_just_inside_a_c0_border(job, tmp_path):
    points, faces = prism(500 - 8e-7)
    lattice = "degree: [2, 2, 2]\npoints: [6, 4, 4]\nborder: c0\n"
    lattice += "box: {min: [0, 0, 0], max: [500, 200, 200]}\n"
    edits = "edits:\n  - move: {at: [4, 2, 2], by: [3, 8, 5]}\n"
    mesh, settled = job(lattice + edits, points, faces)
    written(deform(mesh, settled), tmp_path / "a.step", mesh, settled)


def test_knots_too_close_to_tell_apart_are_refused(job):
    lattice = "degree: [2, 2, 2]\npoints: [5, 3, 3]\nknots: [[0.5, 0.5000001], [], []]\n"
    with pytest.raises(LatticeError, match="nearer than 1e-06") as caught:
        job(lattice)
    assert caught.value.key == "knots[0][1]"


def test_a_box_inside_the_solid_deforms_nothing_and_says_so(job):
    lattice = (
        "degree: [2, 2, 2]\npoints: [4, 4, 4]\nbox: {min: [0.2, 0.2, 0.2], max: [0.8, 0.8, 0.8]}\n"
    )
    mesh, settled = job(lattice + "edits:\n  - move: {at: [1, 1, 1], by: [0.1, 0, 0]}\n")
    report = deform(mesh, settled).report
    assert report["degrees"] == {"plane": 6}
    assert any("nothing is deformed" in warning for warning in report["warnings"])


def test_the_warning_of_many_faces_comes_first_and_once(job, monkeypatch, tmp_path):
    monkeypatch.setattr(refine, "_MANY_FACES", 1)
    text = (
        "degree: [3, 3, 3]\npoints: [6, 4, 4]\nknots: [[0.4, 0.4001], [], []]\n"
        "edits: [{move: {at: [3, 2, 2], by: [0.02, 0.02, 0.02]}}]\n"
    )
    normal = np.array([4, 1, 0.8]) / np.linalg.norm([4, 1, 0.8])
    along = np.cross(normal, [0, 0, 1]) / np.linalg.norm(np.cross(normal, [0, 0, 1]))
    plate = CUBE * [1, 1, 0.2] @ np.array([along, np.cross(normal, along), normal])
    mesh, lattice = job(text, plate)
    stages, told = [], []

    def warn(_):
        told.append(stages[-1])

    result = deform(mesh, lattice, progress=stages.append, warn=warn)
    assert told == ["cut"]
    (warning,) = result.report["warnings"]
    assert "must be cut into about" in warning
    run = ffd("deform", tmp_path / "mesh.obj", tmp_path / "lattice.yaml", "--dry-run")
    assert run.stderr.count("must be cut into about") == 1
    out = tmp_path / "out.brep"
    run = ffd("deform", tmp_path / "mesh.obj", tmp_path / "lattice.yaml", "-o", out)
    assert run.stderr.count("must be cut into about") == 1
