"""Drags taken apart into single-point drags, by Python and by `ffd solve --steps`."""

import json

import numpy as np
import pytest

from ffdcli import read_lattice, read_mesh
from ffdcli.lattice import drag_steps
from support.commands import ffd
from support.lattice_models import settled
from support.plain_files import CUBE

LATTICE = """\
version: 1
volume: nurbs
points: [5, 5, 7]
edits:
  - net: sub/net.npy
  - weight: {at: [2, 2, 5], value: 2}
  - drag:
      pairs: sub/pairs.csv
      pin: [[0, 0, ":"]]
      hold: [{point: [1, 1, 2]}, {inside: {min: [0, 0, 0], max: [2, 3, 0.5]}}]
  - twist: {axis: w, angle: 20}
  - drag: {pairs: [{from: [1, 1, 3], by: [0, 0, 0.1]}], vary: weights}
  - drag:
      pairs: [{from: [1, 1, 4], by: [0, 0, 0.5]}, {from: [2, 1, 4], by: [0, 0, 0.25]}]
"""
PAIRS = "x,y,z,tx,ty,tz\n1,1,3,1.2,1,3.2\n1.5,2,4,1.5,2,4.4\n0.5,1,3.5,0.5,1.2,3.5\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "cube.obj").write_text(CUBE)
    (tmp_path / "lattice.yaml").write_text(LATTICE)
    (tmp_path / "sub").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "sub" / "pairs.csv").write_text(PAIRS)
    (tmp_path / "plain.yaml").write_text("version: 1\npoints: [5, 5, 7]\n")
    monkeypatch.chdir(tmp_path)
    rest = read_lattice("plain.yaml", read_mesh("cube.obj")).points
    np.save("sub/net.npy", rest + 0.1 * np.random.default_rng(0).normal(size=rest.shape))
    return tmp_path


def test_steps_lead_to_the_same_lattice(folder):
    told = ffd("solve", "cube.obj", "lattice.yaml", "-o", "out/solved.yaml", "--steps").stdout
    assert told == "wrote out/solved.yaml and out/solved.steps.yaml\n"
    mesh = read_mesh("cube.obj")
    whole, steps = read_lattice("lattice.yaml", mesh), read_lattice("out/solved.steps.yaml", mesh)
    np.testing.assert_allclose(steps.points, whole.points, rtol=0, atol=1e-12 * mesh.size)
    np.testing.assert_allclose(steps.weights, whole.weights, rtol=0, atol=1e-11)
    solved = read_lattice("out/solved.yaml", mesh)
    assert np.array_equal(solved.volume.net, whole.volume.net)
    # Three pairs and a held point; a drag of weights, which stays whole; two pairs.
    kinds = [edit.name for edit in steps.member.spec.edits]
    assert kinds == ["net", "weight", *["drag"] * 4, "twist", "drag", "drag", "drag"]
    pairs = [len(edit.drag.pairs) for edit in steps.member.spec.edits if hasattr(edit, "drag")]
    assert pairs == [1] * 7


def test_steps_go_to_stdout_without_an_output(folder):
    text = ffd("solve", "cube.obj", "lattice.yaml", "--steps").stdout
    (folder / "steps.yaml").write_text(text)
    mesh = read_mesh("cube.obj")
    whole, steps = read_lattice("lattice.yaml", mesh), read_lattice("steps.yaml", mesh)
    np.testing.assert_allclose(steps.points, whole.points, rtol=0, atol=1e-12 * mesh.size)


def test_json_lists_the_steps(folder):
    found = json.loads(ffd("solve", "cube.obj", "lattice.yaml", "--steps", "--json").stdout)
    assert [step["edit"] for step in found["steps"]] == [2, 2, 2, 2, 5, 5]
    assert set(found["steps"][0]) == {"edit", "from", "by", "to"}
    assert "steps" not in json.loads(ffd("solve", "cube.obj", "lattice.yaml", "--json").stdout)


def test_intermediate_targets_are_where_the_images_are():
    pairs = [
        {"from": [1, 1, 3], "to": [1, 1, 4]},
        {"from": [1.5, 1, 3], "to": [1.5, 1.5, 3]},
        {"from": [1, 1, 5], "by": [0, 0, 0.5]},
    ]
    twist = {"twist": {"axis": "w", "angle": 20}}
    lattice = settled(edits=[twist, {"drag": {"pairs": pairs}}])
    at = settled(edits=[twist])
    for step in drag_steps(lattice):
        at = at.drag([step.source], [step.displacement], by=True)
        np.testing.assert_allclose(at.volume.evaluate(step.source[None]), [step.target], atol=1e-12)
    np.testing.assert_allclose(at.points, lattice.points, atol=1e-12)


def test_rigid_drags_stay_whole(folder):
    text = (
        "version: 1\npoints: [5, 5, 9]\nedits:\n  - drag:\n"
        "      pairs: [{from: [1, 1, 4], to: [1.2, 1, 4.3]}]\n"
        "      hold: [{inside: {min: [0, 0, 3], max: [2, 3, 4]}, rigid: true}]\n"
    )
    (folder / "rigid.yaml").write_text(text)
    steps = ffd("solve", "cube.obj", "rigid.yaml", "--steps").stdout
    assert "# Not a succession of point drags:" in steps
    (folder / "steps.yaml").write_text(steps)
    mesh = read_mesh("cube.obj")
    whole, again = read_lattice("rigid.yaml", mesh), read_lattice("steps.yaml", mesh)
    np.testing.assert_allclose(again.points, whole.points, atol=1e-14)


def test_info_tells_the_weights(folder):
    facts = json.loads(ffd("info", "lattice.yaml", "--mesh", "cube.obj", "--json").stdout)
    assert facts["volume"] == "nurbs"
    assert facts["weights"]["min"] < 1 < facts["weights"]["max"]
    assert facts["edits"] == ["net", "weight", "drag", "twist", "drag", "drag"]
