"""`ffd deform` and its kin with CAD parts as input."""

import json

import cadquery as cq
import numpy as np
import pytest
import trimesh

from ffdcli import read_part
from support import parts
from support.commands import ffd

TWIST = "version: 1\npoints: [4, 4, 5]\nedits:\n  - twist: {axis: w, angle: 25}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    parts.write_part("plate", tmp_path)
    (tmp_path / "twist.yaml").write_text(TWIST)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_part_and_its_report(folder):
    made = json.loads(ffd("deform", "plate.step", "twist.yaml", "-o", "out.step", "--json").stdout)
    assert made["part"]["faces"] == {"cylinder": 7, "plane": 7, "torus": 1}
    assert (made["part"]["bodies"], made["part"]["closed"]) == (1, True)
    assert (made["faces"], made["edges"], made["vertices"]) == (15, 35, 23)
    assert sum(made["faces_by"].values()) == 15
    assert 0 < made["max_error"] < 1e-5 * np.linalg.norm([40, 20, 10])
    assert made["largest_tolerance"]["read"] < made["largest_tolerance"]["written"] < 2e-3
    assert made["bytes"] == (folder / "out.step").stat().st_size
    assert made["warnings"] == []


def test_the_summary_tells_shares_bound_and_tolerances(folder):
    lines = ffd("deform", "plate.step", "twist.yaml", "-o", "out.brep").stdout.splitlines()
    assert lines[0].startswith("out.brep: 1 solid, faces: ")
    assert " fitted" in lines[0]
    assert lines[1].startswith("fitted: faces and edges are within ")
    assert lines[2].startswith("largest tolerance: 1.0e-07 mm as read, ")
    assert lines[3].startswith("no folds")


def test_a_coarser_fit_has_fewer_control_points(folder):
    def made(*options):
        out = ffd("deform", "plate.step", "twist.yaml", "-o", "out.step", *options, "--json")
        return json.loads(out.stdout)

    coarse, fine = made("--fit-tolerance", "0.05"), made("--fit-tolerance", "0.00005")
    assert coarse["control_points"] < fine["control_points"]
    assert coarse["max_error"] <= 0.05
    assert fine["max_error"] <= 0.00005


def test_what_parts_cannot_have_is_refused(folder):
    refused = "needs a mesh, or a part of planes and straight edges"
    for options, message in (
        (("-o", "out.step", "--patches", "bezier"), f"--patches {refused}"),
        (("-o", "out.step", "--coplanar-angle", "1"), f"--coplanar-angle {refused}"),
        (("-o", "out.stl", "--mesh-mode", "uniform"), f"--mesh-mode {refused}"),
    ):
        result = ffd("deform", "plate.step", "twist.yaml", *options, status=2)
        assert message in " ".join(result.stderr.split())
    assert not list(folder.glob("out*"))


@pytest.mark.parametrize("name", ["out.stl", "out.obj", "out.ply", "out.off", "out.glb", "out.3mf"])
def test_triangles_in_every_format(folder, name):
    done = ffd("deform", "plate.step", "twist.yaml", "-o", name, "--mesh-tolerance", "0.05")
    assert "the deformed part is up to 0.0" in done.stdout
    mesh = trimesh.load(name, force="mesh")
    assert mesh.is_watertight
    # A twist about its middle keeps the volume of the plate, which cadquery computes.
    assert mesh.volume == pytest.approx(parts.plate().Volume(), rel=0.01)


def test_a_dry_run_foretells_the_shares_and_writes_nothing(folder):
    told = json.loads(ffd("deform", "plate.step", "twist.yaml", "--dry-run", "--json").stdout)
    assert not list(folder.glob("out*"))
    made = json.loads(ffd("deform", "plate.step", "twist.yaml", "-o", "out.brep", "--json").stdout)
    for key in ("part", "faces", "edges", "faces_by", "edges_by", "jacobian", "unit"):
        assert told[key] == made[key]
    assert told["faces_by"]["fitted"] > 0
    assert told["fit_tolerance"] == pytest.approx(1e-5 * np.linalg.norm([40, 20, 10]))
    lines = ffd("deform", "plate.step", "twist.yaml", "--dry-run").stdout.splitlines()
    shares = told["faces_by"]
    assert lines[0].startswith(
        f"dry run: 15 faces: 0 unchanged, {shares['exact']} exact, {shares['fitted']} to be fitted "
    )
    assert lines[1].startswith("no folds")


def test_a_dry_run_says_that_a_part_is_folded(folder):
    (folder / "fold.yaml").write_text(
        "version: 1\npoints: [4, 4, 4]\nedits: [{move: {at: [0, ':', ':'], by: [60, 0, 0]}}]\n"
    )
    done = ffd("deform", "plate.step", "fold.yaml", "--dry-run")
    assert "folds the model over" in done.stderr


def test_repairs_are_for_meshes(folder):
    for command in (
        ("deform", "plate.step", "twist.yaml", "-o", "out.step"),
        ("verify", "out.step", "plate.step", "twist.yaml"),
        ("solve", "plate.step", "twist.yaml"),
        ("view", "plate.step", "twist.yaml", "-o", "out.png"),
        ("info", "twist.yaml", "--mesh", "plate.step"),
    ):
        result = ffd(*command, "--repair", status=1)
        assert "plate.step: `--repair` is for meshes" in " ".join(result.stderr.split())
    assert not list(folder.glob("out*"))


def test_files_of_other_programs_are_refused_with_what_to_do(folder):
    (folder / "bracket.CATPart").write_bytes(b"V5_CFV2")
    result = ffd("deform", "bracket.CATPart", "twist.yaml", "-o", "out.step", status=1)
    assert "'.catpart' is neither that of a mesh nor that of a CAD part" in result.stderr
    assert "most CAD programs write STEP" in result.stderr


def test_an_open_part_is_no_solid(folder):
    shell = cq.Shell.makeShell(cq.Workplane().cylinder(4, 1).faces("not >Z").vals())
    shell.exportBrep("open.brep")
    result = ffd("deform", "open.brep", "twist.yaml", "-o", "out.brep", "--require-solid", status=1)
    assert "the part is not a closed solid" in result.stderr
    result = ffd("deform", "open.brep", "twist.yaml", "-o", "out.brep")
    assert "the part is open: 1 edge belongs to one face only" in result.stderr
    assert not read_part("out.brep").shell_closed.any()


def test_no_part(folder):
    (folder / "broken.step").write_text("ISO-10303-21;\nHEADER;\n")
    result = ffd("deform", "broken.step", "twist.yaml", "-o", "out.step", status=1)
    assert "broken.step" in result.stderr
    assert not (folder / "out.step").exists()


def test_new_and_solve(folder):
    text = ffd("new", "plate.step").stdout
    assert "{min: [-20.0, -10.0, -2.0], max: [20.0, 10.0, 8.0]}" in text
    ffd("new", "plate.step", "--volume", "tspline", "-o", "octree.yaml")
    made = ffd("deform", "plate.step", "octree.yaml", "-o", "same.step").stdout
    assert "faces: 15 unchanged" in made
    ffd("solve", "plate.step", "twist.yaml", "-o", "solved.yaml")
    one = ffd("deform", "plate.step", "twist.yaml", "-o", "one.brep")
    two = ffd("deform", "plate.step", "solved.yaml", "-o", "two.brep")
    assert one.exit_code == two.exit_code == 0
    first, second = read_part("one.brep"), read_part("two.brep")
    np.testing.assert_allclose(first.points, second.points, atol=1e-12)


def test_info(folder):
    found = json.loads(ffd("info", "plate.step", "--json").stdout)
    assert (found["solids"], found["shells"], found["faces"], found["edges"]) == (1, 1, 15, 35)
    assert found["degrees"] == {"cylinder": 7, "plane": 7, "torus": 1}
    assert (found["closed"], found["rational"], found["unit"]) == (True, False, "mm")
    np.testing.assert_allclose(found["min"] + found["max"], [-20, -10, -2, 20, 10, 8], atol=1e-9)
    placed = json.loads(ffd("info", "twist.yaml", "--mesh", "plate.step", "--json").stdout)
    assert placed["box"]["min"] == pytest.approx(found["min"])
    assert placed["jacobian"]["injective"] == "yes"
