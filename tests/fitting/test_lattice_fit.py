"""Lattices embedded by the inverse, through the whole run: fitted, stated, verified."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import ffdcli.fitting.lattice_fit
import ffdcli.fitting.volume_fit
from ffdcli import deform, deform_mesh, prepare, read_lattice, read_mesh
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError
from ffdcli.fitting.parametrization import parametrize
from ffdcli.lattice.octree_placement import require_preimages
from ffdcli.mesh import triangles
from ffdcli.verify.file import allowed_deviation, verify_file
from support.commands import ffd

HEAD = "version: 1\nvolume: tspline\noctree: {depth: 3, embedding: inverse}\n"
EDITS = """\
edits:
  - move: {at: {near: [0, 0, 10]}, by: [0, 0, 2]}
  - drag: {pairs: [{from: [0, 10, 0], by: [0, 1, 1]}]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    trimesh.creation.icosphere(1, 10.0).export(folder / "ball.obj")
    (folder / "l.yaml").write_text(HEAD + EDITS)
    return folder


@pytest.fixture(scope="module")
def ball(folder):
    return read_mesh(folder / "ball.obj")


@pytest.fixture(scope="module")
def lattice(folder, ball):
    return read_lattice(folder / "l.yaml", ball)


@pytest.fixture(scope="module")
def tolerance(ball):
    return 1e-4 * ball.size


@pytest.fixture(scope="module")
def plan(ball, lattice, tolerance):
    return prepare(ball, lattice, fit_tolerance=tolerance)


@pytest.fixture(scope="module")
def result(folder, plan, lattice):
    return plan.deform(lattice).write(folder / "out.step")


def written(folder, text, name="other.yaml"):
    path = folder / name
    path.write_text(text)
    return path


def points_of(mesh, count=2000):
    """Points all over a mesh."""
    corners, _ = triangles(mesh)
    random = np.random.default_rng(11)
    share = random.dirichlet([1, 1, 1], count)
    return np.einsum(
        "nk,nkx->nx", share, mesh.vertices[corners[random.integers(len(corners), size=count)]]
    )


def test_a_fit_is_stated_and_within_its_tolerance(result, tolerance):
    report = result.report
    assert (report["solids"], report["watertight"], report["exact"]) == (1, True, False)
    assert report["fit"]["tolerance"] == tolerance
    assert 0 < report["fit"]["largest_found"] < report["fit"]["bound"] <= tolerance
    assert report["max_error"] == report["fit"]["bound"] == result.max_error
    assert report["fit"]["samples"] > 1000
    assert not report["rational"]


def test_the_file_holds_the_true_deformation_within_the_bound(folder, ball, lattice, result):
    allowed = allowed_deviation(result.report, "report", ball)
    assert allowed < 1.01 * result.max_error
    verdict = verify_file(
        folder / "out.step", ball, lattice, tolerance=allowed, expected_error=result.max_error
    )
    assert verdict.passed, verdict.reasons
    assert verdict.valid
    # It is judged by the lattice itself: what the fit is off shows.
    assert verdict.max_deviation > 0.2 * result.max_error


def images(volumes, points):
    """Where points of the boxes go, by direct evaluation."""
    return Deformation(tuple(volumes), np.zeros((len(volumes), 2, 3))).images(points)


def test_images_of_the_fit_are_near_those_of_the_lattice(ball, lattice, plan, result):
    points = points_of(ball)
    true = images(lattice.maps, points)
    off = np.linalg.norm(images(plan.volumes, points) - true, axis=1)
    assert off.max() <= result.max_error
    assert np.linalg.norm(true - points, axis=1).max() > 0.5
    # The other embedding of the same control points is out of the bound.
    (volume,) = lattice.maps
    other = images([volume.displacement], points)
    assert np.linalg.norm(other - true, axis=1).max() > 2 * result.max_error


def test_drags_meet_their_targets(lattice):
    source = np.array([[0.0, 10.0, 0.0]])
    before = images(lattice.maps, source)
    assert np.abs(before - [[0, 11, 1]]).max() < 1e-9
    again = lattice.drag(source, [[0, 12, 0]])
    assert np.abs(images(again.maps, source) - [[0, 12, 0]]).max() < 1e-9


def test_a_plan_serves_other_edits(ball, lattice, plan, result):
    half = plan.deform(lattice.scaled(0.5))
    assert half.brep.face_count == result.brep.face_count
    assert half.max_error == pytest.approx(result.max_error / 2, rel=1e-3)
    with pytest.raises(LatticeError, match="fitted within"):
        plan.deform(lattice.scaled(50))


def test_a_plan_does_not_serve_the_other_embedding(folder, ball, plan):
    text = (HEAD + EDITS).replace("inverse", "displacement")
    other = read_lattice(written(folder, text), ball)
    with pytest.raises(LatticeError, match="prepared for other"):
        plan.deform(other)
    exact = prepare(ball, other)
    with pytest.raises(LatticeError, match="prepared for other"):
        exact.deform(plan.fitted.asked)


def test_at_rest_it_is_the_identity_exactly(folder, ball):
    result = deform(ball, read_lattice(written(folder, HEAD), ball))
    assert result.report["exact"]
    assert result.report["degrees"] == {"plane": result.brep.face_count}
    assert np.array_equal(np.unique(result.brep.points, axis=0), np.unique(ball.vertices, axis=0))


def test_reducing_adds_its_bound(ball, lattice, plan, result, tolerance):
    reduced = plan.deform(lattice, tolerance=tolerance)
    assert result.max_error < reduced.max_error <= result.max_error + tolerance
    assert reduced.report["control_points"] < result.report["control_points"]


def test_mesh_modes_deform_by_the_lattice_itself(ball, lattice):
    made = deform_mesh(ball, lattice, mode="vertices")
    assert np.array_equal(made.points, images(lattice.maps, ball.vertices))
    assert made.report["jacobian"]["injective"] == "unproved"
    assert any("only its vertices" in warning for warning in made.report["warnings"])
    with pytest.raises(LatticeError, match="nothing is fitted"):
        deform_mesh(ball, lattice, mode="vertices", fit_tolerance=1.0)


def test_folds_of_the_deformation_are_found(folder, ball):
    text = HEAD + "edits:\n  - move: {at: {near: [0, 0, 10]}, by: [40, 0, 0]}\n"
    asked = read_lattice(written(folder, text), ball)
    made = deform_mesh(ball, asked, mode="vertices", check=False)
    assert made.report["jacobian"]["injective"] == "no"
    assert made.report["jacobian"]["value"] < 0


def test_points_without_parameters_are_refused_by_number_and_place(folder, ball):
    text = HEAD + "box: {min: [-11, -11, -11], max: [11, 11, 10]}\n" + EDITS
    asked = read_lattice(written(folder, text), ball)
    with pytest.raises(LatticeError) as caught:
        deform(ball, asked)
    message = caught.value.message
    assert "of 42 sampled points of the mesh" in message
    count = int(message.split()[0])
    assert count >= (ball.vertices[:, 2] > 9.99).sum() > 0
    assert "control points of the side w_max beside them move" in message
    assert caught.value.key == "octree.embedding"
    assert "box: auto" in caught.value.hint


def test_points_between_vertices_are_looked_at_too(folder):
    """Large faces pass through large cells where no vertex is: one finest cell more is no help."""
    trimesh.creation.box((8, 10, 12)).export(folder / "box.obj")
    box = read_mesh(folder / "box.obj")
    part = "also: [{min: [-2, -2, 4.5], max: [2, 2, 5.5], depth: 5}]"
    text = HEAD.replace("inverse", f"inverse, refine: vertices, {part}")
    text += "edits:\n  - transform: {at: {index: ':', hidden: true}, translate: [1, 0, 0]}\n"
    asked = read_lattice(written(folder, text), box)
    assert parametrize(box, asked).points == 8
    with pytest.raises(LatticeError, match="have no parameters in the volume at rest"):
        deform(box, asked)


def test_folds_of_the_volume_at_rest_are_refused(lattice):
    (volume,) = lattice.maps
    points = np.array([[0.0, 0.0, 9.0], [1.0, 2.0, 3.0]])
    found = volume.parameters(points)
    folding = found.slopes * np.array([1.0, -1.0])[:, None, None]
    with pytest.raises(LatticeError) as caught:
        require_preimages(volume, replace(found, slopes=folding), points, lattice.source)
    assert "1 of 2 sampled points of the mesh has parameters where" in caught.value.message
    place = volume.frame.to_model(points[1:])[0]
    assert caught.value.message.endswith(f"({', '.join(f'{x:.6g}' for x in place)})")
    assert "weights" in caught.value.hint


def test_what_cannot_be_reached_is_refused_with_what_can(ball, lattice, monkeypatch):
    monkeypatch.setattr(ffdcli.fitting.volume_fit, "MOST_FUNCTIONS", 1500)
    with pytest.raises(LatticeError) as caught:
        deform(ball, lattice, fit_tolerance=1e-6)
    assert "but not within 1e-06" in caught.value.message
    hint = caught.value.hint
    reachable = float(hint.split("--fit-tolerance ")[1].split(",")[0])
    assert deform(ball, lattice, fit_tolerance=reachable, check=False).max_error <= reachable


@pytest.mark.parametrize(("text", "words"), [
    (HEAD.replace("tspline", "hierarchical"), "needs no inverse"),
    (HEAD + "edits:\n  - drag: {pairs: [{from: [0, 10, 0], by: [0, 1, 0]}],"
     " hold: [{inside: {min: [0, 0, 9], max: [1, 1, 11]}}]}\n", "cannot be held"),
    (HEAD + "edits:\n  - drag: {pairs: [{from: [14, 0, 0], by: [0, 1, 0]}]}\n", "no parameters"),
    (HEAD + "edits:\n  - hammer: {point: [13.2, 13.2, 13.2], height: 1}\n", "no parameters"),
])  # fmt: skip
def test_what_is_not_built_is_refused_by_name(folder, ball, text, words):
    with pytest.raises(LatticeError) as caught:
        read_lattice(written(folder, text), ball)
    assert words in caught.value.message + caught.value.hint


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.inf, np.nan])
def test_a_fit_tolerance_is_a_length(ball, lattice, tolerance):
    with pytest.raises(LatticeError, match="positive length"):
        deform(ball, lattice, fit_tolerance=tolerance)


def test_commands_say_how_it_is_fitted(folder, ball, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(ffdcli.fitting.lattice_fit, "DEFAULT_TOLERANCE", 1e-3)

    written(folder, HEAD + EDITS.splitlines(keepends=True)[0] + EDITS.splitlines()[1] + "\n")
    done = ffd("deform", "ball.obj", "other.yaml", "-o", "o.step", "--report", "o.json")
    stated = json.loads((folder / "o.json").read_text())
    assert stated["fit"]["tolerance"] == pytest.approx(1e-3 * ball.size)
    bound = f"{stated['max_error']:.2e} mm"
    assert f"fitted: the faces are within {bound} of the deformed mesh" in done.stdout
    assert (
        "passed" in ffd("verify", "o.step", "ball.obj", "other.yaml", "--against", "o.json").stdout
    )
    facts = json.loads(ffd("info", "other.yaml", "--mesh", "ball.obj", "--json").stdout)
    assert facts["octree"]["embedding"] == "inverse"
    assert facts["default_fit_tolerance"] == pytest.approx(1e-3 * ball.size)
    exact = written(folder, "version: 1\n", "exact.yaml")
    refused = ffd("deform", "ball.obj", exact, "-o", "no.step", "--fit-tolerance", 1, status=1)
    assert "this one is exact" in refused.stderr
    wrong = ["--mesh-mode", "vertices", "--fit-tolerance", 1]
    ffd("deform", "ball.obj", "other.yaml", "-o", "no.stl", *wrong, status=2)
    assert not list(folder.glob("no.*"))


def test_a_report_is_whole_without_a_fit(ball, folder):
    exact = read_lattice(written(folder, "version: 1\n"), ball)
    assert "fit" not in deform(ball, exact, check=False).report
    with pytest.raises(LatticeError, match="this one is exact"):
        deform(ball, exact, fit_tolerance=1.0)
