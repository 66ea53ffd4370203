"""The command `ffd fit` with a scan."""

import json

import numpy as np
import pytest

from ffdcli import fit_field, read_lattice, read_mesh
from ffdcli.lattice.export.fit_text import FitChoice
from support.commands import ffd
from support.scans import FACES, NOISE, SCANNED, body, write_mesh

CHOICE = ("--volume", "bspline", "--points", "6", "6", "6", "--tolerance", NOISE)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "model.obj", *body(3))
    write_mesh(tmp_path / "scan.ply", SCANNED, FACES)
    return tmp_path


def test_the_pairs_found_are_kept_and_give_the_same_lattice_exactly(folder):
    run = ffd("fit", "model.obj", "scan.ply", "-o", "l.yaml", *CHOICE)
    assert "of the scan, which cover 100.0% of the model\n" in run.stdout
    assert run.stdout.endswith("wrote l.yaml and l.pairs.npz\n")
    text = (folder / "l.yaml").read_text()
    assert text.startswith("# The scan scan.ply, fitted for model.obj.")
    assert "pairs: l.pairs.npz" in text
    assert "target" not in text
    mesh = read_mesh("model.obj")
    choice = FitChoice("bspline", points=(6, 6, 6), tolerance=NOISE)
    found = fit_field(mesh, "scan.ply", choice, output="l.yaml", name="model.obj")
    np.testing.assert_array_equal(read_lattice("l.yaml", mesh).points, found.lattice.points)
    assert found.pairs.text == text
    # The text without pairs looks for them again.
    (folder / "again.yaml").write_text(found.text)
    np.testing.assert_array_equal(read_lattice("again.yaml", mesh).points, found.lattice.points)


def test_the_report_has_both_distances_and_files_are_not_overwritten(folder):
    options = ("-o", "l.yaml", *CHOICE, "--reach", "0.4", "--json")
    report = json.loads(ffd("fit", "model.obj", "scan.ply", *options).stdout)
    scan = report["fits"][0]["scan"]
    assert scan["reach"] == 0.4
    assert scan["coverage"] == 1
    assert 0 < scan["scan_to_model"]["rms"] < scan["scan_to_model"]["largest"]
    assert len(scan["model_to_scan"]["largest_at"]) == 3
    assert report["files"] == ["l.yaml", "l.pairs.npz"]
    (folder / "l.yaml").unlink()
    run = ffd("fit", "model.obj", "scan.ply", "-o", "l.yaml", *CHOICE, status=1)
    assert "l.pairs.npz: this file exists already" in run.stderr


@pytest.mark.parametrize(
    ("field", "option", "words"),
    [
        ("scan.ply", ("--field", "u"), "`field` is for a field of displacements"),
        ("f.csv", ("--reach", "1"), "`reach` is for a scan"),
    ],
)
def test_options_of_the_other_kind_of_file_are_refused(folder, field, option, words):
    (folder / "f.csv").write_text("x,y,z,dx,dy,dz\n0,0,0,0,0,0.1\n")
    run = ffd("fit", "model.obj", field, "-o", "l.yaml", *option, status=1)
    assert words in run.stderr
    assert not (folder / "l.yaml").exists()
