"""Real meshes, if they are installed: every closed one gives one valid closed solid per body.

The quick test runs by default; the whole table runs with ``python -m pytest -m sweep``.
"""

import numpy as np
import pytest

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.brep.evaluate.integrate import centre_of, shell_volumes
from ffdcli.brep.evaluate.lookup import model_of_read
from ffdcli.brep.evaluate.trim import outlines
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.extract import extract
from ffdcli.brep.occ.reading.step import read_step
from ffdcli.mesh import triangles
from ffdcli.surface.needles import triangle_areas
from ffdcli.verify import volume_of_brep
from ffdcli.verify.file import DEFAULT_TOLERANCE, verify_file
from support.places import REAL_MESHES

pytestmark = pytest.mark.skipif(not REAL_MESHES.is_dir(), reason="../shared/meshes is not there")

CLOSED = ("nut.ply", "shuttle.obj", "cow.obj", "fandisk.off")
TABLE = [
    (name, degree, points, patches)
    for name in CLOSED
    for degree in (2, 3)
    for points in ((4, 4, 4), (6, 5, 7))
    for patches in ("merged", "bezier")
]


def smooth_lattice(folder, mesh, degree, points, seed=1, strength=0.06):
    """A random smooth displacement of all control points."""
    path = folder / "lattice.yaml"
    path.write_text(f"version: 1\ndegree: {[degree] * 3}\npoints: {list(points)}\n")
    lattice = read_lattice(path, mesh)
    rest, box = lattice.volume.rest_points, lattice.volume.box
    place = (rest - box[0]) / (box[1] - box[0])
    rng = np.random.default_rng(seed)
    shift = np.zeros_like(rest)
    for _ in range(4):
        wave = (place * rng.uniform(0.5, 3, 3)).sum(axis=-1, keepdims=True)
        shift += rng.normal(size=3) * np.sin(wave + rng.uniform(0, 2 * np.pi))
    shift *= strength * (box[1] - box[0]).max() / np.abs(shift).max()
    return lattice.with_net(rest + shift)


def run(folder, name, degree, points, patches):
    """Deform, write, re-read, compare counts and volume, verify; one line for the log."""
    mesh = read_mesh(REAL_MESHES / name)
    lattice = smooth_lattice(folder, mesh, degree, points)
    path = folder / "out.step"
    result = deform(mesh, lattice, patches=patches).write(path)
    report = result.report
    assert report["solids"] == report["mesh"]["bodies"] == 1
    assert report["watertight"]

    shape = read_step(path).shape
    read = extract(shape)
    verdict = kernel_check(shape)
    assert verdict.valid, verdict.faults
    assert verdict.closed
    counts = (read.face_count, len(read.edges), len(read.points), read.solid_count)
    assert counts == tuple(report[key] for key in ("faces", "edges", "vertices", "solids"))
    degrees = {}
    for batch in read.surfaces:
        key = "x".join(str(d) for d in sorted(batch.degrees))
        degrees[key] = degrees.get(key, 0) + len(batch.surfaces)
    # The file holds a surface for each face; in memory faces may share one.
    if patches == "merged":
        assert degrees == {k: n for k, n in report["degrees"].items() if k != "plane"}
    model = model_of_read(read)
    _, volumes, _ = shell_volumes(model, outlines(model), centre_of(model))
    # Where the mesh's planes are noisy, OpenCascade's reader moves some pcurves by as much.
    corners, _ = triangles(mesh)
    area = np.linalg.norm(triangle_areas(mesh.vertices, corners), axis=1).sum()
    slack = report["plane_deviation"] * area if report["plane_deviation"] > 1e-12 * mesh.size else 0
    assert volumes == pytest.approx(volume_of_brep(result.brep)[1], rel=1e-9, abs=slack)

    # The mesh's own plane deviation, stated, where it is larger than the default.
    allowed = max(DEFAULT_TOLERANCE * mesh.size, report["plane_deviation"])
    verified = verify_file(path, mesh, lattice, tolerance=allowed)
    print(
        f"\n{name} degree {degree} points {points} {patches}: {report['faces']} faces, "
        f"deviation {verified.max_deviation / mesh.size:.1e}, "
        f"planes {report['plane_deviation'] / mesh.size:.1e}, "
        f"volume {abs(verified.volume / verified.expected_volume - 1):.1e}"
    )
    assert verified.passed, verified.reasons


def test_a_machined_part_in_single_precision(tmp_path):
    run(tmp_path, "nut.ply", 3, (6, 5, 7), "merged")


@pytest.mark.sweep
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("name", "degree", "points", "patches"), TABLE)
def test_closed_meshes(tmp_path, name, degree, points, patches):
    run(tmp_path, name, degree, points, patches)


@pytest.mark.sweep
@pytest.mark.timeout(3600)
def test_a_scan_of_56172_triangles(tmp_path):
    run(tmp_path, "bunny.obj", 2, (4, 4, 4), "merged")


@pytest.mark.parametrize("name", ["Spider_ascii.stl", "blv_mgn_cube_350_platform.3mf"])
def test_faulty_meshes_are_refused_by_name(tmp_path, name):
    from ffdcli.errors import MeshError

    mesh = read_mesh(REAL_MESHES / name)
    with pytest.raises(MeshError, match=name):
        deform(mesh, smooth_lattice(tmp_path, mesh, 2, (4, 4, 4)))


@pytest.mark.sweep
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("name", "solids"), [("Spider_ascii.stl", 14), ("blv_mgn_cube_350_platform.3mf", 7)]
)
def test_faulty_meshes_are_mended(tmp_path, name, solids):
    mesh = read_mesh(REAL_MESHES / name, repair=True)
    lattice = smooth_lattice(tmp_path, mesh, 2, (3, 3, 3), strength=0.02)
    result = deform(mesh, lattice)
    assert result.report["solids"] == solids
    assert any("repaired: " in warning for warning in result.report["warnings"])
    assert kernel_check(result.kernel_shape).valid


def test_an_open_mesh_gives_a_valid_open_shell(tmp_path):
    mesh = read_mesh(REAL_MESHES / "elephant-with-holes.off")
    result = deform(mesh, smooth_lattice(tmp_path, mesh, 2, (4, 4, 4)))
    assert (result.report["solids"], result.report["watertight"]) == (0, False)
    assert kernel_check(result.kernel_shape).valid
