"""Every sample: deformed by the command line and by Python, written, re-read, verified."""

import importlib.util
import json

import numpy as np
import pytest

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.brep.occ.processes.process import KernelProcess
from ffdcli.mesh import inspect, triangles
from ffdcli.verify.file import verify_file
from support.commands import ffd
from support.places import MESHES, SAMPLES


@pytest.fixture(scope="module")
def made_again(tmp_path_factory):
    """A folder with the sample meshes, made by their script."""
    spec = importlib.util.spec_from_file_location("make_samples", SAMPLES / "make_samples.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("samples")
    module.main(folder)
    return folder


def area(mesh):
    corners = mesh.vertices[triangles(mesh)[0]]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.linalg.norm(np.cross(a, b), axis=1).sum() / 2


def read(name):
    mesh = read_mesh(MESHES[name])
    return mesh, read_lattice(SAMPLES / f"{name}.yaml", mesh)


def test_there_are_samples_of_every_sort_and_they_are_small():
    assert {"bracket", "bottle", "creature", "handle"} <= set(MESHES)
    sizes = [path.stat().st_size for path in SAMPLES.iterdir() if path.is_file()]
    assert max(sizes) < 400_000
    assert sum(sizes) < 2_000_000


@pytest.mark.parametrize("name", MESHES)
def test_sample_becomes_one_closed_solid_that_verifies(name, tmp_path):
    mesh, lattice = read(name)
    out = tmp_path / f"{name}.step"
    files = [MESHES[name], SAMPLES / f"{name}.yaml"]
    report = json.loads(ffd("deform", *files, "-o", out, "--json", kernel=KernelProcess).stdout)
    assert report["solids"] == 1
    assert report["watertight"]
    assert report["exact"]
    assert report["unit"] == "mm"
    assert report["plane_deviation"] < 1e-12 * mesh.size

    same = deform(mesh, lattice).report
    for key in ("faces", "edges", "vertices", "control_points", "degrees", "warnings"):
        assert same[key] == report[key]

    verdict = verify_file(out, mesh, lattice, tolerance=1e-11 * mesh.size, unit="mm")
    assert verdict.passed, verdict.reasons
    assert verdict.valid
    assert verdict.watertight
    assert verdict.faces == report["faces"]
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_sample_lattice_deforms_without_folding(name):
    mesh, lattice = read(name)
    volume = lattice.volume
    low, high = volume.box
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 3, indexing="ij"), axis=-1)
    points = low + grid.reshape(-1, 3) * (high - low)
    assert np.linalg.det(volume.jacobian(points)).min() > 0.3
    moved = np.linalg.norm(volume.evaluate(points) - points, axis=1)
    assert moved.max() > 0.01 * mesh.size


@pytest.mark.parametrize("name", ["bracket", "handle"])
def test_nothing_moves_outside_a_lattice_smaller_than_the_mesh(name):
    mesh, lattice = read(name)
    assert lattice.crossed
    box = lattice.volume.frame.to_model(lattice.volume.box)
    outside = ((mesh.vertices < box[0]) | (mesh.vertices > box[1])).any(axis=1)
    written = {tuple(point) for point in deform(mesh, lattice).brep.points.tolist()}
    # Vertices between collinear edges go away; all others are there, to the last bit.
    kept = [tuple(point) in written for point in mesh.vertices[outside].tolist()]
    assert all(kept)
    assert len(kept) > 50


@pytest.mark.parametrize("name", MESHES)
def test_sample_meshes_are_sound_and_can_be_made_again(name, made_again):
    mesh = read_mesh(MESHES[name])
    soundness = inspect(mesh)
    assert soundness.closed
    assert soundness.bodies == 1
    assert not mesh.notes

    again = read_mesh(made_again / MESHES[name].name)
    assert again.bounds == pytest.approx(mesh.bounds, abs=1e-3)
    # The kernel's triangles may change from version to version; the shape does not.
    assert inspect(again).volumes == pytest.approx(soundness.volumes, rel=1e-3)
    assert area(again) == pytest.approx(area(mesh), rel=1e-3)
    if name != "bracket":
        assert again.vertices == pytest.approx(mesh.vertices, abs=1e-3)
        assert again.polygon_count == mesh.polygon_count
    if name not in ("bracket", "creature"):
        # Rounding decides which of two equal diagonals splits a square of the creature.
        assert np.array_equal(again.corners, mesh.corners)
