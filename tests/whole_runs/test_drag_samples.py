"""The samples of dragging: solved, deformed, written, re-read, verified; what the paper shows."""

import importlib.util

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.mesh import inspect, triangles
from ffdcli.verify.file import verify_file
from support.commands import ffd
from support.places import SAMPLES

DRAGS = SAMPLES / "drags"
MESHES = {
    "bottle": SAMPLES / "bottle.obj",
    "cup": DRAGS / "cylinder.obj",
    "ears": SAMPLES / "creature.ply",
    "fish-4": DRAGS / "fish.obj",
    "fish-7": DRAGS / "fish.obj",
    "fish-10": DRAGS / "fish.obj",
    "flange": DRAGS / "flange.obj",
}


def read(name):
    mesh = read_mesh(MESHES[name])
    return mesh, read_lattice(DRAGS / f"{name}.yaml", mesh)


def images(lattice, points):
    frame = lattice.volume.frame
    return frame.to_model(lattice.volume.evaluate(frame.to_local(np.asarray(points))))


def on_surface(mesh, count=20):
    """Points of the mesh: corners, and some inside every triangle."""
    corners, _ = triangles(mesh)
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], size=(len(corners), count))
    inside = np.einsum("tkc,tcx->tkx", shares, mesh.vertices[corners]).reshape(-1, 3)
    return np.concatenate([mesh.vertices, inside])


def test_all_samples_are_here_and_small():
    assert {path.stem for path in DRAGS.glob("*.yaml")} == set(MESHES)
    assert sum(path.stat().st_size for path in DRAGS.iterdir()) < 200_000


@pytest.mark.parametrize("name", MESHES)
def test_sample_becomes_one_closed_solid_that_verifies(name, tmp_path):
    mesh, lattice = read(name)
    assert lattice.warnings == ()
    result = deform(mesh, lattice).write(tmp_path / "out.step")
    assert result.report["solids"] == 1
    assert result.report["watertight"]
    verdict = verify_file(tmp_path / "out.step", mesh, lattice, tolerance=1e-11 * mesh.size)
    assert verdict.passed, verdict.reasons
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_every_dragged_point_arrives(name):
    mesh, lattice = read(name)
    (table,) = lattice.member.definition.pairs.values()
    before = np.where(table.by[:, None], table.sources, 0)
    found = images(lattice, table.sources)
    np.testing.assert_allclose(found, before + table.goals, rtol=0, atol=1e-12 * mesh.size)


@pytest.mark.parametrize("name", MESHES)
def test_sample_bends_the_mesh_without_folding_it(name):
    mesh, lattice = read(name)
    local = lattice.volume.frame.to_local(on_surface(mesh))
    local = local[lattice.volume.contains(local)]
    assert np.linalg.det(lattice.volume.jacobian(local)).min() > 0.3
    moved = np.linalg.norm(images(lattice, mesh.vertices) - mesh.vertices, axis=1)
    assert moved.max() > 0.04 * mesh.size


def test_finer_lattices_keep_the_fishs_middle_as_it_was():
    mesh, _ = read("fish-4")
    points = on_surface(mesh)
    middle = points[np.abs(points[:, 1] - 89) < 30]
    moved = [
        np.linalg.norm(images(read(f"fish-{count}")[1], middle) - middle, axis=1).max()
        for count in (4, 7, 10)
    ]
    # Their Fig. 5: the finer the lattice, the nearer the deformation stays to the sources.
    assert moved[0] > 3 * moved[1] > 9 * moved[2]


def test_nothing_moves_but_the_head():
    mesh, lattice = read("ears")
    assert lattice.crossed == ("w_min",)
    below = mesh.vertices[mesh.vertices[:, 2] < 64]
    written = {tuple(point) for point in deform(mesh, lattice).brep.points.tolist()}
    assert all(tuple(point) in written for point in below.tolist())


def test_the_flange_moves_as_one_and_the_upper_end_stays():
    mesh, lattice = read("flange")
    points = on_surface(mesh)
    foot, top = points[points[:, 2] <= 8], points[points[:, 2] >= 92]
    after = images(lattice, foot)
    turn, _ = Rotation.align_vectors(after - after.mean(axis=0), foot - foot.mean(axis=0))
    carried = turn.apply(foot - foot.mean(axis=0)) + after.mean(axis=0)
    assert np.abs(carried - after).max() < 1e-11
    assert np.rad2deg(turn.magnitude()) > 3
    np.testing.assert_allclose(images(lattice, top), top, rtol=0, atol=1e-12)


def test_steps_of_the_fish_lead_to_the_same_lattice(tmp_path):
    out = tmp_path / "fish.yaml"
    ffd("solve", MESHES["fish-7"], DRAGS / "fish-7.yaml", "-o", out, "--steps", "--quiet")
    mesh, lattice = read("fish-7")
    steps = read_lattice(tmp_path / "fish.steps.yaml", mesh)
    assert len(steps.member.spec.edits) == 4
    np.testing.assert_allclose(steps.points, lattice.points, rtol=0, atol=1e-12 * mesh.size)
    assert np.array_equal(read_lattice(out, mesh).points, lattice.points)


def test_the_samples_can_be_made_again(tmp_path):
    spec = importlib.util.spec_from_file_location("drag_samples", SAMPLES / "make_drag_samples.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    for name in ("cylinder.obj", "fish.obj", "flange.obj"):
        again, kept = read_mesh(tmp_path / name), read_mesh(DRAGS / name)
        np.testing.assert_allclose(again.vertices, kept.vertices, atol=1e-9)
        assert np.array_equal(again.corners, kept.corners)
        assert inspect(kept).closed
        assert kept.notes == ()
    assert (tmp_path / "cup.csv").read_text().count("\n") == 57
