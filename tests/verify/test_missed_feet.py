"""Correct results whose nearest points local searches miss: folded, thin, reduced."""

import json

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.evaluate import branch_and_bound
from ffdcli.fitting.lattice_fit import DEFAULT_TOLERANCE as fit_default
from ffdcli.verify.file import FIT_TOLERANCE, allowed_deviation, verify_file
from support.commands import ffd
from support.jobs import read_job


def plate(random, corners=9, thickness=0.15):
    """A thin plate with a convex outline, about a hundred long."""
    angle = np.sort((np.arange(corners) + random.uniform(0, 0.7, corners)) * 2 * np.pi / corners)
    outline = np.stack([60 * np.cos(angle), 40 * np.sin(angle)], axis=1)
    low, high = np.zeros((corners, 1)), np.full((corners, 1), thickness)
    points = np.vstack([np.hstack([outline, low]), np.hstack([outline, high])])
    number = np.arange(corners)
    after = np.roll(number, -1)
    sides = np.stack([number, after, after + corners, number + corners], axis=1)
    return points, [number[::-1], number + corners, *sides]


def folding(random, degree, points, count, across):
    """Moves so large that the lattice folds the plate over."""
    text = f"degree: {degree}\npoints: {points}\nedits:\n"
    for _ in range(count):
        at = random.integers(0, points).tolist()
        by = (random.uniform(-1, 1, 3) * [25, 25, across]).tolist()
        text += f"  - move: {{at: {at}, by: {by}}}\n"
    return text


def case(folder, seed, **options):
    """A folded plate's mesh, lattice, and report, with its file written."""
    random = np.random.default_rng(seed)
    mesh, lattice = read_job(folder, folding(random, [2, 2, 2], [4, 3, 3], 11, 0.3), *plate(random))
    result = deform(mesh, lattice, **options).write(folder / "out.step")
    assert result.report["jacobian"]["injective"] == "no"
    return mesh, lattice, result.report


@pytest.mark.parametrize(("seed", "options"), [(1, {"tolerance": 0.003, "max_degree": 3}), (2, {})])
def test_what_local_searches_miss_is_found_by_bounds(tmp_path, seed, options):
    mesh, lattice, report = case(tmp_path, seed, **options)
    allowed = allowed_deviation(report, "report", mesh)
    verdict = verify_file(
        tmp_path / "out.step", mesh, lattice, tolerance=allowed, expected_error=report["max_error"]
    )
    assert verdict.passed, (verdict.reasons, verdict.undecided)
    assert verdict.max_deviation <= allowed


def test_what_is_not_decided_is_neither_passed_nor_failed(tmp_path, monkeypatch):
    monkeypatch.setattr(branch_and_bound, "EFFORT", 0)
    mesh, lattice, report = case(tmp_path, 1)
    allowed = allowed_deviation(report, "report", mesh)
    verdict = verify_file(tmp_path / "out.step", mesh, lattice, tolerance=allowed)
    assert not verdict.passed
    assert verdict.reasons == ()
    assert "are not decided within the effort allowed" in verdict.undecided[0]
    run = ffd("verify", *[tmp_path / n for n in ("out.step", "mesh.obj", "lattice.yaml")], status=4)
    assert "UNDECIDED" in run.stdout
    assert "undecided: " in run.stderr


BALL = """volume: tspline
octree: {depth: 1, embedding: inverse}
edits:
  - move: {at: {near: [0, 0, 1]}, by: [0, 0, 0.3]}
"""


def test_fitted_files_are_judged_by_the_default_of_the_fit(tmp_path, monkeypatch):
    monkeypatch.setattr("ffdcli.verify.file._SAMPLES", 200)
    mesh, lattice = read_job(tmp_path, BALL)
    assert fit_default == FIT_TOLERANCE
    deform(mesh, lattice).write(tmp_path / "out.step")
    files = [tmp_path / name for name in ("out.step", "mesh.obj", "lattice.yaml")]
    verdict = json.loads(ffd("verify", *files, "--json").stdout)
    assert verdict["passed"]
    assert verdict["tolerance"] == pytest.approx(FIT_TOLERANCE * mesh.size, rel=1e-12)
    read_job(tmp_path, BALL.replace("0.3", "0.301"))
    run = ffd("verify", *files, status=3)
    assert "hint: if OUT was made with --fit-tolerance, give the report" in run.stderr
