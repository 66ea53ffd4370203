"""`ffd deform --dry-run` and `--profile`."""

import json
import sys

import pytest

from ffdcli.brep.occ.processes.process import KernelProcess
from support.commands import ffd
from support.places import SAMPLES

FILES = [SAMPLES / "handle.obj", SAMPLES / "handle.yaml"]
STAGES = ["read", "check mesh", "planes", "cut", "outlines", "plan"]


def run(*arguments, status=0):
    return ffd("deform", *FILES, *arguments, status=status, kernel=KernelProcess)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "h.igs"
    done = run("-o", out, "--profile", "--json")
    return json.loads(done.stdout), done.stderr


def test_a_dry_run_foretells_the_report_and_writes_nothing(report, tmp_path):
    made, _ = report
    done = run("-o", tmp_path / "h.igs", "--dry-run", "--json")
    told = json.loads(done.stdout)
    assert told["dry_run"] is True
    assert told["format"] == "IGES"
    for name in ("faces", "patches", "edges", "control_points"):
        assert told[name] == made[name]
    assert 0.75 < told["bytes"] / made["bytes"] < 1.34
    assert 2 < told["seconds"] < 10
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_needs_no_output_and_says_what_is_asked():
    done = run("--dry-run")
    assert done.stdout.startswith("dry run: 218 faces, 1456 control points, about ")
    assert " kB of STEP in " in done.stdout


def test_without_a_dry_run_an_output_is_required():
    done = run(status=2)
    assert "Missing option '-o' / '--output'" in done.stderr


def test_a_dry_run_still_refuses_what_the_run_would_refuse(tmp_path):
    done = run("-o", tmp_path / "h.dxf", "--dry-run", status=1)
    assert "cannot write a file of kind '.dxf'" in done.stderr
    sheet = tmp_path / "sheet.obj"
    sheet.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    ffd("deform", sheet, FILES[1], "--dry-run", "--require-solid", status=1)


def test_the_profile_names_every_stage(report):
    made, said = report
    names = [stage["stage"] for stage in made["profile"]]
    after = ["jacobian", "surfaces", "load kernel", "build", "check", "write"]
    assert names == STAGES + after
    assert all(name in said for name in names)
    for stage in made["profile"]:
        if stage["stage"] != "read":
            assert stage["seconds"] == pytest.approx(made["seconds"][stage["stage"]], abs=0.1)
    if sys.platform == "linux":
        peaks = [stage["peak_bytes"] for stage in made["profile"]]
        assert all(2e7 < peak < 2e9 for peak in peaks)
        # OpenCascade alone takes more than this.
        assert made["profile"][-1]["kernel_peak_bytes"] > 1e8


def test_the_profile_of_a_dry_run(tmp_path):
    done = run("--dry-run", "--profile", "--json")
    assert [stage["stage"] for stage in json.loads(done.stdout)["profile"]] == STAGES
    assert "OpenCascade" not in done.stderr
