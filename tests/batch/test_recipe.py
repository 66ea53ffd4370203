"""The recipe for continuous integration: its jobs file and its command do what its text says."""

import subprocess

import pytest
import yaml

from support.batch_models import CUBE, OPEN, command, environment
from support.places import ROOT

RECIPE = ROOT / "docs" / "ci-recipe"
BEND = """\
version: 1
degree: [2, 2, 2]
edits:
  - bend: {axis: w, toward: u, angle: ${angle}}
"""


@pytest.fixture
def steps():
    (job,) = yaml.safe_load((RECIPE / "convert.yml").read_text())["jobs"].values()
    return job["steps"]


def test_workflow_runs_the_batch_and_keeps_what_it_made(steps):
    commands = [step["run"] for step in steps if "run" in step]
    assert commands[-1] == "ffd batch jobs.yaml"
    kept = [step for step in steps if step.get("if") == "always()"]
    assert "summary.csv" in kept[-1]["with"]["path"]


def test_jobs_of_the_recipe(tmp_path):
    for name, text in {
        "meshes/cube.obj": CUBE,
        "meshes/open.obj": OPEN,
        "lattices/bend.yaml": BEND,
        "jobs.yaml": (RECIPE / "jobs.yaml").read_text(),
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    done = subprocess.run(
        command("jobs.yaml"), cwd=tmp_path, env=environment(), capture_output=True, text=True
    )
    assert done.returncode == 1
    assert "verified: out/cube-0.5.step" in done.stderr
    assert "failed  out/open-1.step" in done.stderr
    assert "the mesh is open, and a solid is required" in done.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "cube-0.5.step",
        "cube-1.step",
    ]
