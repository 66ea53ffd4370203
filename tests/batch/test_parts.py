"""CAD parts as input of jobs: deformed, verified, refused by name."""

import json
from dataclasses import replace

import pytest

from ffdcli import pipeline
from ffdcli.batch import single_job
from ffdcli.batch.jobs import Job
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


def test_a_kept_part_gives_the_same_bytes(folder, monkeypatch):
    plans = []
    prepare = pipeline.prepare
    monkeypatch.setattr(pipeline, "prepare", lambda *a, **k: plans.append(1) or prepare(*a, **k))
    first = Job("cylinder.step", "twist.yaml", "first.step", str(folder))
    second = replace(first, output="second.step", scale=0.5)

    def made(job):
        return single_job.run_job(job, epoch="1700000000")["sha256"]

    single_job._kept.clear()
    kept = made(first), made(second)
    assert len(plans) == 1
    single_job._kept.clear()
    assert (made(second), made(first)) == kept[::-1]
    assert len(set(kept)) == 2
