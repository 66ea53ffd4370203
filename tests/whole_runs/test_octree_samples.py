"""The samples on octrees: whole runs to a closed solid that verifies."""

import pytest

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.verify.file import allowed_deviation, verify_file
from support.jobs import ellipsoid
from support.places import SAMPLES


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("mesh", "lattice"),
    [
        ("octree/tree.ply", "tree"),
        ("creature.ply", "creature"),
        ("handle.obj", "handle"),
        ("bottle.obj", "bottle"),
    ],
)
def test_samples_on_octrees_verify(mesh, lattice, tmp_path):
    record = read_mesh(SAMPLES / mesh)
    settled = read_lattice(SAMPLES / "octree" / f"{lattice}.yaml", record)
    result = deform(record, settled).write(tmp_path / "out.step")
    assert result.report["solids"] == 1
    assert result.report["watertight"]
    assert result.report["exact"]
    allowed = allowed_deviation(result.report, "report", record)
    verdict = verify_file(tmp_path / "out.step", record, settled, tolerance=allowed)
    assert verdict.passed, verdict.reasons


@pytest.mark.sweep
def test_the_sample_embedded_by_the_inverse_verifies(tmp_path):
    record = read_mesh(SAMPLES / "creature.ply")
    settled = read_lattice(SAMPLES / "octree" / "creature-inverse.yaml", record)
    tolerance = 1e-4 * record.size
    result = deform(record, settled, fit_tolerance=tolerance).write(tmp_path / "out.step")
    report = result.report
    assert (report["solids"], report["watertight"], report["exact"]) == (1, True, False)
    assert 0 < report["max_error"] <= tolerance
    assert report["jacobian"]["injective"] == "yes"
    allowed = allowed_deviation(report, "report", record)
    verdict = verify_file(
        tmp_path / "out.step", record, settled, tolerance=allowed, expected_error=result.max_error
    )
    assert verdict.passed, verdict.reasons


def test_samples_on_octrees_are_small():
    sizes = [path.stat().st_size for path in (SAMPLES / "octree").iterdir() if path.is_file()]
    assert max(sizes) < 300_000


@pytest.mark.parametrize("text", [
    "volume: hierarchical\noctree: {depth: 2}\nedits:\n"
    "  - move: {at: {near: [6, 0, 3], level: 2}, by: [0.2, 0, 0.5]}\n",
    "volume: tspline\noctree: {depth: 2}\nedits:\n"
    "  - move: {at: {near: [6, 0, 3]}, by: [0.2, 0, 0.5]}\n",
    "volume: tspline\noctree: {depth: 2}\nedits:\n"
    "  - weight: {at: {near: [6, 0, 3]}, value: 300}\n"
    "  - move: {at: {near: [6, 0, 3]}, by: [0.2, 0, 0.5]}\n",
], ids=["hierarchical", "tspline", "weights"])  # fmt: skip
def test_each_kind_becomes_a_closed_solid_that_verifies(text, tmp_path):
    record = ellipsoid(tmp_path, 1)
    path = tmp_path / "l.yaml"
    path.write_text("version: 1\n" + text)
    settled = read_lattice(path, record)
    result = deform(record, settled).write(tmp_path / "out.step")
    report = result.report
    assert (report["solids"], report["watertight"], report["exact"]) == (1, True, True)
    verdict = verify_file(tmp_path / "out.step", record, settled)
    assert verdict.passed, verdict.reasons
    assert verdict.max_deviation < 1e-12 * record.size
