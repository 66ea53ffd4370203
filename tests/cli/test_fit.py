"""The command `ffd fit`: the lattice file that it writes, and what it says."""

import json
import os

import numpy as np
import pytest

from ffdcli import read_lattice, read_mesh
from support.commands import ffd
from support.field_files import FORMATS, POINTS, npz, vtu
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS

POINTS_IN = np.random.default_rng(7).uniform(0, 2, (60, 3))
TURN = np.array([[0, 0.02, 0], [0, 0, 0.01], [0.03, 0, 0.05]])
MOVES = POINTS_IN @ TURN.T + [0.1, 0, 0]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    *rest, last = obj(CORNERS * 2, QUADS).splitlines(keepends=True)
    (tmp_path / "cube.obj").write_text(f"{''.join(rest)}g side\n{last}")
    (tmp_path / "f.npz").write_bytes(npz(points=POINTS_IN, displacements=MOVES))
    return tmp_path


def read(name="l.yaml"):
    return read_lattice(name, read_mesh("cube.obj"))


def images(lattice, points=POINTS_IN):
    return lattice.maps[0].evaluate(points)


def test_the_file_is_what_a_person_would_write(folder):
    run = ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml")
    assert (folder / "l.yaml").read_text() == (
        "# The displacements of f.npz, fitted for cube.obj. To deform:\n"
        "#   ffd deform cube.obj l.yaml -o out.step\n"
        "version: 1\nunit: mm\nvolume: hierarchical\ndegree: [3, 3, 3]\noctree: {depth: auto}\n"
        "edits:\n  - fit:\n      pairs: f.npz\n"
    )
    assert "fitted:   60 pairs\n" in run.stdout
    assert "within:   100.00% of the pairs within 0.000346" in run.stdout
    assert "folding:  no folds" in run.stdout
    assert run.stdout.endswith("wrote l.yaml\n")
    np.testing.assert_allclose(images(read()), POINTS_IN + MOVES, atol=1e-9)


def test_every_choice_is_in_the_file(folder):
    (folder / "f.npz").write_bytes(npz(points=POINTS_IN / 10, displacements=MOVES / 10))
    options = "--unit cm --scale -1 --tolerance 0.5 --smooth 1e-3 --no-robust --hold side"
    options += " --degree 2 --max-depth 3 --max-points 900"
    ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", *options.split())
    text = (folder / "l.yaml").read_text()
    assert "degree: [2, 2, 2]\noctree: {depth: auto, max_depth: 3, max_points: 900}\n" in text
    assert text.endswith(
        "      pairs: f.npz\n      unit: cm\n      scale: -1.0\n      tolerance: 0.5\n"
        "      smooth: 0.001\n      robust: false\n      hold: [{group: side}]\n"
    )
    assert json.loads(ffd("info", "l.yaml", "--json").stdout)["unit"] == "mm"


@pytest.mark.parametrize("volume", ["bspline", "nurbs"])
def test_lattices_in_rows(folder, volume):
    options = f"--volume {volume} --points 4 5 6"
    ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", *options.split())
    lattice = read()
    assert lattice.points.shape == (4, 5, 6, 3)
    np.testing.assert_allclose(images(lattice), POINTS_IN + MOVES, atol=1e-9)


def test_the_field_is_named_relative_to_the_lattice_file(folder):
    (folder / "run").mkdir()
    (folder / "run" / "with blank.npz").write_bytes((folder / "f.npz").read_bytes())
    ffd("fit", "cube.obj", folder / "run" / "with blank.npz", "-o", "l.yaml")
    assert 'pairs: "run/with blank.npz"\n' in (folder / "l.yaml").read_text()
    ffd("fit", "cube.obj", "f.npz", "-o", "run/l.yaml")
    assert "pairs: ../f.npz\n" in (folder / "run" / "l.yaml").read_text()
    np.testing.assert_allclose(images(read("run/l.yaml")), POINTS_IN + MOVES, atol=1e-9)


def test_a_mesh_file_with_a_result(folder):
    pytest.importorskip("meshio")
    inside = POINTS / 2 + 0.1
    (folder / "r.vtu").write_bytes(vtu([("U", inside * 0.01), ("V", inside)], inside))
    run = ffd("fit", "cube.obj", "r.vtu", "-o", "l.yaml", status=1)
    assert "it holds several fields of three numbers for each node: `U`, `V`" in run.stderr
    assert not (folder / "l.yaml").exists()
    ffd("fit", "cube.obj", "r.vtu", "--field", "U", "-o", "l.yaml")
    assert "      pairs: r.vtu\n      field: U\n" in (folder / "l.yaml").read_text()
    (folder / "a.inp").write_bytes(FORMATS["f.inp"][0])
    (folder / "b.inp").write_bytes(FORMATS["f.inp"][0])
    ffd("fit", "cube.obj", "a.inp", "--targets", "b.inp", "-o", "m.yaml")
    assert "      pairs: a.inp\n      targets: b.inp\n" in (folder / "m.yaml").read_text()


def test_the_fitted_net_can_be_written_in_place_of_the_fit(folder):
    run = ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", "--solved")
    assert "wrote " in run.stdout
    text = (folder / "l.yaml").read_text()
    assert "net:" in text
    assert "fit:" not in text
    os.unlink("f.npz")
    np.testing.assert_allclose(images(read()), POINTS_IN + MOVES, atol=1e-9)


def test_without_a_name_the_file_goes_to_stdout(folder):
    run = ffd("fit", "cube.obj", "f.npz")
    assert run.stdout.startswith("# The displacements of f.npz")
    assert run.stdout.endswith("pairs: f.npz\n")
    assert "fitted:   60 pairs" in run.stderr
    assert ffd("fit", "cube.obj", "f.npz", "--quiet").stderr == ""


def test_deform_says_what_the_fit_reached(folder):
    ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml")
    for output in ("out.step", "out.stl"):
        run = ffd("deform", "cube.obj", "l.yaml", "-o", output)
        assert "\nresidual: rms " in run.stdout
        assert "\nwithin:   100.00% of the pairs within" in run.stdout


def test_json_has_the_figures_and_the_verdict(folder):
    found = json.loads(ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", "--json").stdout)
    assert (found["output"], found["files"]) == ("l.yaml", ["l.yaml"])
    assert found["fits"][0]["pairs"] == 60
    assert found["fits"][0]["largest"] < 1e-9
    assert found["jacobian"]["injective"] == "yes"
    assert "scale" not in found["jacobian"]
    found = json.loads(ffd("fit", "cube.obj", "f.npz", "--json").stdout)
    assert found["output"] is None
    assert found["text"].endswith("pairs: f.npz\n")


def test_a_fold_is_said_with_the_scale_that_does_not_fold(folder):
    """x is turned over: 1 - 2 s, so that the limit of s is 1/2."""
    moves = POINTS_IN * [-2, 0, 0] + [2, 0, 0]
    # Part of the points only, since a mirror image of all is no fold.
    moves[:, 0] *= POINTS_IN[:, 2] / 2
    (folder / "f.npz").write_bytes(npz(points=POINTS_IN, displacements=moves))
    options = ("--volume", "bspline", "--points", 4, 4, 4)
    run = ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", *options)
    assert "folding:  folded over" in run.stdout
    scale = float(run.stdout.split("scaled by up to ")[1].split()[0])
    assert 0.45 < scale <= 0.5


def test_an_existing_file_is_kept(folder):
    (folder / "l.yaml").write_text("mine")
    run = ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", status=1)
    assert "this file exists already (choose another name, or overwrite it with" in run.stderr
    assert (folder / "l.yaml").read_text() == "mine"
    ffd("fit", "cube.obj", "f.npz", "-o", "l.yaml", "--force")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--points 4 4 4", "--points needs --volume bspline or nurbs"),
        ("--volume bspline --octree-depth 3", "--octree-depth needs --volume hierarchical"),
        ("--volume nurbs --max-depth 3", "--max-depth needs --volume hierarchical"),
        ("--octree-depth 3 --max-depth 3", "limits of cells halved as needed"),
        ("--scale 0", "--scale 0 moves nothing"),
        ("--tolerance nan", "not a finite number"),
        ("--unit parsec", "is not one of"),
    ],
)
def test_wrong_usage(options, words):
    run = ffd("fit", "cube.obj", "f.npz", *options.split(), status=2)
    assert words in " ".join(run.stderr.split())


@pytest.mark.parametrize(
    ("field", "content", "words"),
    [
        ("none.npz", None, "none.npz: there is no such file"),
        ("f.txt", b"", "neither that of a field nor that of a scan"),
        ("g.csv", b"x,y,z,dx,dy,dz\n1,1,1,0,0,nan\n", "pair 1 holds a number that is not finite"),
        ("g.csv", b"x,y,z,dx,dy,dz\n9,9,9,0,0,1\n", "edits[0].fit"),
    ],
)
def test_bad_fields_are_refused_and_nothing_is_written(folder, field, content, words):
    if content is not None:
        (folder / field).write_bytes(content)
    run = ffd("fit", "cube.obj", field, "-o", "l.yaml", status=1)
    assert words in run.stderr
    assert not (folder / "l.yaml").exists()
