"""`ffd info LATTICE --mesh MESH` counts what Song & Yang 2005, Table 1, counts."""

import json
import re

import numpy as np
import pytest

from ffdcli import read_mesh
from ffdcli.cli.folding_text import scale_text
from support.commands import ffd
from support.places import SAMPLES

TREE = SAMPLES / "octree" / "tree.ply"


@pytest.mark.parametrize(("depth", "regular"), [(3, 729), (4, 4913), (5, 35937)])
def test_control_points_by_octree_and_by_regular_subdivision(tmp_path, depth, regular):
    path = tmp_path / "l.yaml"
    path.write_text(f"version: 1\nvolume: tspline\noctree: {{depth: {depth}, refine: vertices}}\n")
    facts = json.loads(ffd("info", path, "--mesh", TREE, "--json").stdout)
    assert facts["control_points_if_regular"] == regular
    assert facts["control_points"] < (0.65 if depth == 3 else 0.4) * regular
    assert facts["exposed"] + facts["hidden"] == facts["control_points"]
    assert sum(facts["cells_by_level"]) == facts["cells"]
    # Cells with a vertex are the finest, and as many as places of the finest grid that hold one.
    points = read_mesh(TREE).vertices
    low, high = (np.array(facts["box"][end]) for end in ("min", "max"))
    places = np.floor((points - low) / (high - low) * 2**depth).astype(int)
    assert facts["cells_with_mesh"] == len(np.unique(places, axis=0))
    assert facts["jacobian"]["bound"] == 1.0


FILES = [
    ("bracket.yaml", "bracket.obj"),
    ("octree/tree.yaml", "octree/tree.ply"),
    ("octree/creature.yaml", "creature.ply"),
    ("octree/handle.yaml", "handle.obj"),
    ("drags/flange.yaml", "drags/flange.obj"),
]
# What a Python value looks like when it is printed.
PYTHON = re.compile(r"[{}'\[]|\b(None|True|False|array\(|dict|np\.)")


def assert_plain(text):
    assert text
    found = PYTHON.search(text)
    # A message may name a key of the lattice file, such as edits[0].
    assert found is None or found.group() == "[", text


@pytest.mark.parametrize(("lattice", "mesh"), FILES)
def test_no_python_is_printed_of_lattices_and_meshes(lattice, mesh):
    assert_plain(ffd("info", SAMPLES / lattice).stdout)
    assert_plain(ffd("info", SAMPLES / lattice, "--mesh", SAMPLES / mesh).stdout)
    assert_plain(ffd("info", SAMPLES / mesh).stdout)


@pytest.mark.parametrize("suffix", [".step", ".iges", ".brep"])
def test_no_python_is_printed_of_cad_files(tmp_path, suffix):
    folder = SAMPLES / "drags"
    out = tmp_path / f"out{suffix}"
    ffd("deform", folder / "fish.obj", folder / "fish-4.yaml", "-o", out)
    assert_plain(ffd("info", out).stdout)


def test_no_python_is_printed_of_files_with_lists(tmp_path):
    path = tmp_path / "l.yaml"
    path.write_text(
        "version: 1\nlattices:\n"
        "  - box: {center: [0, 0, 0], size: [1, 1, 1], axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}\n"
        "  - {volume: tspline, box: {min: [1, 0, 0], max: [2, 1, 1]}, octree: {depth: 2, also: "
        "[{min: [1, 0, 0], max: [2, 1, 1], depth: 3}, {min: [1, 0, 0], max: [2, 1, 1], "
        "depth: 1}]}}\n"
    )
    told = ffd("info", path).stdout.replace("lattices[0]", "").replace("lattices[1]", "")
    assert_plain(told)
    assert "also min 1 0 0 max 2 1 1 depth 3; min 1 0 0 max 2 1 1 depth 1" in told
    assert "axes 1 0 0; 0 1 0; 0 0 1" in told


def equal_verdicts(tmp_path, mesh, lattice, *options):
    report = tmp_path / "report.json"
    told = ffd("deform", mesh, lattice, "-o", tmp_path / "out.brep", "--report", report, *options)
    asked = ("info", lattice, "--mesh", mesh, *options)
    verdict = json.loads(report.read_text())["jacobian"]
    assert json.loads(ffd(*asked, "--json").stdout)["jacobian"] == verdict
    words = told.stdout.strip().splitlines()[-1]
    assert ffd(*asked).stdout.strip().splitlines()[-1].endswith(words)
    return verdict


@pytest.mark.parametrize("lattice", ["fish-4", "fish-7"])
def test_info_and_deform_give_one_verdict(tmp_path, lattice):
    folder = SAMPLES / "drags"
    equal_verdicts(tmp_path, folder / "fish.obj", folder / f"{lattice}.yaml")


@pytest.mark.sweep
@pytest.mark.parametrize(("lattice", "mesh"), FILES)
def test_info_and_deform_give_one_verdict_on_samples(tmp_path, lattice, mesh):
    equal_verdicts(tmp_path, SAMPLES / mesh, SAMPLES / lattice)


def test_info_and_deform_give_one_verdict_on_a_fitted_lattice(tmp_path):
    path = tmp_path / "inverse.yaml"
    path.write_text(
        "version: 1\nvolume: tspline\noctree: {depth: 2, embedding: inverse, weights: [10, 1]}\n"
        "edits:\n  - move: {at: {near: [20, 20, 60]}, by: [1, 0, 2]}\n"
    )
    mesh = SAMPLES / "drags" / "cylinder.obj"
    verdict = equal_verdicts(tmp_path, mesh, path, "--fit-tolerance", "0.05")
    assert verdict["injective"] == "yes"


@pytest.mark.parametrize(
    ("proved", "complete", "expected"),
    [
        (1.5, True, "proved up to 1.5; folds at 2, at (1, 2, 3)"),
        (
            1.5,
            False,
            "proved up to 1.5, unproved above: the effort allowed was spent; "
            "folds at 2, at (1, 2, 3)",
        ),
        (0.0, False, "nothing proved: the effort allowed was spent; folds at 2, at (1, 2, 3)"),
    ],
)
def test_the_line_on_scales_says_how_far_they_are_proved(proved, complete, expected):
    scale = {"proved": proved, "folds": 2.0, "at": [1.0, 2.0, 3.0], "complete": complete}
    assert scale_text(scale) == expected
