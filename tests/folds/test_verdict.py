"""Folds of whole models: on the surface, inside, in cavities, beside; and what the commands say."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from ffdcli import deform, injective_scale, prepare, read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.folds import certificate
from ffdcli.folds.model import place_in_each
from ffdcli.folds.verdict import judge
from ffdcli.mesh import shells
from support.commands import ffd
from support.places import MESHES, SAMPLES

DRAGS = {
    "bottle": SAMPLES / "bottle.obj",
    "cup": SAMPLES / "drags/cylinder.obj",
    "ears": SAMPLES / "creature.ply",
    "fish-10": SAMPLES / "drags/fish.obj",
    "fish-4": SAMPLES / "drags/fish.obj",
    "fish-7": SAMPLES / "drags/fish.obj",
    "flange": SAMPLES / "drags/flange.obj",
}
BOX = "box: {min: [-1, -1, -1], max: [1, 1, 1]}\ndegree: [3, 3, 3]\npoints: [7, 7, 7]\nborder: c1\n"
# In the middle of the box, where a small ball is hollow or full: folded there, nowhere else.
FOLDED = BOX + "edits:\n  - move: {at: [3, 3, 3], by: [3, 0, 0]}\n"


def ball(radius, subdivisions=2):
    return trimesh.creation.icosphere(subdivisions, radius)


@pytest.fixture
def job(job):
    """As the ``job`` of all tests, for bodies of trimesh."""

    def make(lattice, *bodies):
        return job(lattice, mesh=trimesh.util.concatenate(bodies).export(file_type="obj"))

    return make


def judged(mesh, lattice):
    return judge(lattice, place_in_each(mesh, shells(mesh), lattice.maps))


def turned(body):
    body.invert()
    return body


def test_a_fold_inside_the_solid_is_found_with_a_point_inside(job):
    mesh, lattice = job(FOLDED, ball(0.9))
    on_surface = lattice.volume.jacobian(mesh.vertices)
    assert np.linalg.det(on_surface).min() > 0.5
    found = judged(mesh, lattice)
    assert found.locally_injective == "no"
    assert np.linalg.norm(found.at) < 0.9
    assert np.linalg.det(lattice.volume.jacobian(found.at[None]))[0] == pytest.approx(found.value)
    assert found.value < 0


@pytest.mark.parametrize("sense", [1, -1])
def test_the_share_of_the_surface_that_is_folded(job, sense):
    """Beyond the knot at 0.5 the linear map turns back: a quarter of four sides and one side."""
    lattice = (
        "box: {min: [-1, -1, -1], max: [1, 1, 1]}\ndegree: [1, 1, 1]\npoints: [3, 2, 2]\n"
        "knots: [[0.75], [], []]\nedits:\n"
        "  - move: {at: [1, ':', ':'], by: [2, 0, 0]}\n"
        f"  - transform: {{at: [':', ':', ':'], scale: [1, 1, {sense}]}}\n"
    )
    found = judged(*job(lattice, trimesh.creation.box((2, 2, 2))))
    assert found.report["injective"] == "no"
    # The standard deviation of 10,000 random points would be 0.005; these are spread by area.
    assert found.report["folded"]["share"] == pytest.approx(1 / 3, abs=0.01)
    assert found.report["folded"]["samples"] == 10_000
    assert "% of its surface is folded" in found.problem


def test_a_fold_inside_only_leaves_the_surface_unfolded(job):
    assert judged(*job(FOLDED, ball(0.9))).report["folded"]["share"] == 0


def test_the_same_fold_in_a_cavity_or_beside_the_model_does_no_harm(job):
    shell = judged(*job(FOLDED, ball(0.95, 3), turned(ball(0.85, 3))))
    assert shell.locally_injective == "yes"
    assert not shell.globally_injective
    beside = trimesh.creation.box((0.3, 0.3, 0.3))
    beside.apply_translation((0.8, 0.8, 0.8))
    assert judged(*job(FOLDED, beside)).locally_injective == "yes"


def test_an_open_mesh_has_no_inside(job):
    open_ball = ball(0.9, 3)
    open_ball.update_faces(np.arange(len(open_ball.faces)) > 0)
    assert judged(*job(FOLDED, open_ball)).locally_injective == "yes"
    sheet = trimesh.Trimesh(
        [[-0.9, -0.9, 0], [0.9, -0.9, 0], [0.9, 0.9, 0], [-0.9, 0.9, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    folded = judged(*job(FOLDED, sheet))
    assert folded.locally_injective == "no"
    assert folded.at[2] == 0


def test_models_that_reach_out_or_lie_beside(job):
    bar = trimesh.creation.box((6, 0.8, 0.8))
    lattice = BOX + "edits:\n  - move: {at: ['2:5', ':', ':'], by: [0, 0, 0.4]}\n"
    through = judged(*job(lattice, bar))
    assert (through.locally_injective, through.globally_injective) == ("yes", True)
    far = trimesh.creation.box()
    far.apply_translation((9, 0, 0))
    assert judged(*job(FOLDED, far)).report == {"injective": "yes", "bound": 1.0, "global": "yes"}


def test_a_mirror_is_injective(job):
    mesh, lattice = job(
        BOX + "edits:\n  - transform: {at: [':', ':', ':'], scale: [1, 1, -1]}\n", ball(0.9)
    )
    report = deform(mesh, lattice).report
    jacobian = report["jacobian"]
    assert (jacobian["injective"], jacobian["mirrored"], jacobian["global"]) == ("yes", True, "yes")
    assert jacobian["bound"] == pytest.approx(1)
    assert report["warnings"] == []


@pytest.mark.parametrize("name", [*MESHES, *(f"drags/{name}" for name in DRAGS)])
def test_samples_are_proved_injective(name):
    mesh = read_mesh(MESHES[name] if name in MESHES else DRAGS[Path(name).name])
    lattice = read_lattice(SAMPLES / f"{name}.yaml", mesh)
    found = judged(mesh, lattice)
    assert found.locally_injective == "yes"
    assert found.problem is None
    samples = np.clip(mesh.vertices, *lattice.volume.frame.to_model(lattice.volume.box))
    local = lattice.volume.frame.to_local(samples)
    assert np.linalg.det(lattice.volume.jacobian(local)).min() >= found.bound > 0.1


def test_scales_up_to_the_limit_are_injective_and_one_beyond_is_not(job):
    mesh, lattice = job(FOLDED, ball(0.9))
    limit = injective_scale(mesh, lattice)
    assert limit.folds is not None
    assert 0.9 * limit.folds < limit.proved < limit.folds < 1
    points = np.random.default_rng(0).normal(size=(20000, 3))
    points *= (
        0.88
        * np.random.default_rng(1).uniform(size=(20000, 1)) ** 0.33
        / np.linalg.norm(points, axis=1, keepdims=True)
    )
    for share in (0.3, 0.7, 1.0):
        below = lattice.scaled(share * limit.proved)
        assert np.linalg.det(below.volume.jacobian(points)).min() > 0
        assert judged(mesh, lattice.scaled(0.97 * share * limit.proved)).locally_injective == "yes"
    above = lattice.scaled(limit.folds)
    assert np.linalg.det(above.volume.jacobian(limit.at[None]))[0] < 0
    with pytest.raises(LatticeError, match="the largest scale must be"):
        injective_scale(mesh, lattice, most=0)


def test_scales_stop_before_weights_vanish(job):
    weights = (
        "volume: nurbs\n"
        + BOX.replace("7", "5")
        + "edits:\n  - weight: {at: [2, 2, 2], value: 0.5}\n"
    )
    limit = injective_scale(*job(weights, ball(0.9)))
    assert limit.folds is None
    assert 1.9 < limit.proved < 2


def test_the_command_warns_and_with_require_injective_refuses(job, tmp_path):
    job(FOLDED, ball(0.9, 1))
    files = [tmp_path / "mesh.obj", tmp_path / "lattice.yaml"]
    out = tmp_path / "out.step"
    told = ffd("deform", *files, "-o", out)
    report = json.loads(ffd("deform", *files, "-o", out, "--json").stdout)
    jacobian = report["jacobian"]
    assert jacobian["injective"] == "no"
    place = ", ".join(f"{x:.9g}" for x in jacobian["at"])
    assert f"det J is {jacobian['value']:.3g} at ({place})" in told.stderr
    assert "folded" in told.stdout
    assert report["warnings"] == [told.stderr.strip().removeprefix("warning: ")]
    out.unlink()
    refused = ffd("deform", *files, "-o", out, "--require-injective", "--json", status=1)
    error = json.loads(refused.stdout)["error"]
    assert error["kind"] == "lattice"
    assert error["file"] == str(files[1])
    assert place in error["message"]
    share = float(error["hint"].split()[2])
    assert not out.exists()
    mesh = read_mesh(files[0])
    lattice = read_lattice(files[1], mesh)
    plan = prepare(mesh, lattice)
    plan.deform(lattice.scaled(share), require_injective=True)
    with pytest.raises(LatticeError, match="folds the model over"):
        plan.deform(lattice, require_injective=True)


def test_info_tells_of_folds_and_scales(job, tmp_path):
    job(FOLDED, ball(0.9, 1))
    files = [tmp_path / "lattice.yaml", "--mesh", tmp_path / "mesh.obj"]
    facts = json.loads(ffd("info", *files, "--injective-scale", "--json").stdout)
    assert facts["jacobian"]["injective"] == "no"
    scale = facts["injective_scale"]
    assert 0 < scale["proved"] < scale["folds"] < 1
    assert len(scale["at"]) == 3
    assert "folded over: det J is -" in ffd("info", *files).stdout
    assert "needs --mesh" in ffd("info", files[0], "--injective-scale", status=2).stderr


def test_what_the_first_step_of_a_proof_leaves_is_proved_by_the_second(job, monkeypatch):
    text = BOX + "volume: nurbs\nedits:\n  - weight: {at: [3, 3, 3], value: 1.5}\n"
    found = judged(*job(text, ball(0.9, 1)))
    monkeypatch.setattr(certificate, "form_products", lambda volume: 0)
    left = judged(*job(text, ball(0.9, 1)))
    assert (found.locally_injective, left.locally_injective) == ("yes", "yes")
