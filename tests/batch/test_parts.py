"""CAD parts as input of jobs: deformed, verified, refused by name."""

import json

import pytest

from support import parts
from support.commands import ffd

JOBS = """\
version: 1
jobs:
  - {mesh: cylinder.step, lattice: twist.yaml, output: bent.step, verify: true}
  - {mesh: cylinder.step, lattice: twist.yaml, output: coarse.igs, options: {fit_tolerance: 0.01}}
  - {mesh: cylinder.step, lattice: twist.yaml, output: never.step, options: {patches: bezier}}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    parts.write_part("cylinder", tmp_path)
    twist = "version: 1\npoints: [4, 4, 5]\nedits:\n  - twist: {axis: w, angle: 25}\n"
    (tmp_path / "twist.yaml").write_text(twist)
    (tmp_path / "jobs.yaml").write_text(JOBS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_jobs_of_parts(folder):
    found = json.loads(ffd("batch", "jobs.yaml", "--json", status=1).stdout)
    bent, coarse, never = sorted(found["jobs"], key=lambda job: job["output"])
    assert (bent["status"], coarse["status"], never["status"]) == ("verified", "done", "failed")
    assert bent["verification"]["passed"]
    assert bent["verification"]["faces"] == 3
    assert bent["report"]["part"]["faces"] == {"cylinder": 1, "plane": 2}
    assert coarse["report"]["max_error"] <= 0.01
    assert coarse["report"]["control_points"] < bent["report"]["control_points"]
    assert "the option `patches` is for planes" in never["error"]["message"]
    assert not (folder / "never.step").exists()
