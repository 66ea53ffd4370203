"""Whole runs with a tolerance: smaller files that hold what they state."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ffdcli import deform, prepare
from ffdcli.brep.evaluate.face_points import edge_points
from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.read import read_cad
from ffdcli.errors import FfdError
from support.commands import ffd
from support.jobs import EDITS

LATTICE = "degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + EDITS


def ball(steps):
    """An octahedron, its triangles divided into four, so many times."""
    points = np.vstack([np.eye(3), -np.eye(3)])
    faces = np.array(
        [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    )
    for _ in range(steps):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, which = np.unique(sides, axis=0, return_inverse=True)
        middle = points[edges].mean(axis=1)
        a, b, c = (which.reshape(-1, 3) + len(points)).T
        p, q, r = faces.T
        points = np.vstack([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate(
            [np.column_stack(t) for t in ((p, a, c), (a, q, b), (c, b, r), (a, b, c))]
        )
    return points, faces


def require_sound(path):
    """Re-read: valid and closed."""
    verdict = kernel_check(read_cad(path).shape)
    assert verdict.valid, verdict.faults
    assert verdict.closed


def points_off(exact, reduced):
    """Largest distance of the same points of surfaces, and of curves."""
    both = [model_of_brep(brep) for brep in (exact, reduced)]
    edge = edge_points(both[0])
    curves = [model.on_edges(edge.edge, edge.at)[0] for model in both]
    curved = np.ones(exact.face_count, dtype=bool)
    curved[np.isin(exact.face_surface, exact.planes.surfaces)] = False
    face = np.repeat(np.flatnonzero(curved), 400)
    low, high = both[0].domain[face, 0], both[0].domain[face, 1]
    uv = low + np.random.default_rng(0).random(low.shape) * (high - low)
    faces = [model.on_faces(face, uv)[0] for model in both]
    return max(np.linalg.norm(a - b, axis=1).max(initial=0) for a, b in (faces, curves))


@pytest.mark.parametrize("suffix", [".step", ".iges", ".brep"])
def test_a_reduced_ball_holds_what_it_states(job, tmp_path, suffix):
    mesh, lattice = job(LATTICE, *ball(1))
    plan = prepare(mesh, lattice)
    exact = plan.deform(lattice)
    tolerance = 1e-6 * mesh.size
    reduced = plan.deform(lattice, tolerance=tolerance)
    path = tmp_path / f"ball{suffix}"
    report = reduced.write(path).report
    require_sound(path)
    assert points_off(exact.brep, reduced.brep) <= report["max_error"]
    assert not report["exact"]
    assert 0.3 * tolerance < report["max_error"] <= tolerance
    assert report["control_points"] < 0.7 * exact.report["control_points"]
    assert exact.report["exact"]
    assert exact.report["max_error"] == 0
    assert report["bytes"] < 0.9 * exact.write(tmp_path / f"exact{suffix}").report["bytes"]


@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1),
    degrees=st.tuples(*[st.integers(1, 4)] * 3),
    tolerance=st.sampled_from([1e-8, 1e-5, 1e-3]),
    max_degree=st.sampled_from([None, 3, 4]),
    volume=st.sampled_from(["bspline", "nurbs"]),
)
def test_any_lattice(job, tmp_path, seed, degrees, tolerance, max_degree, volume):
    rng = np.random.default_rng(seed)
    moves = [
        f"  - move: {{at: {rng.integers(0, 2, 3).tolist()}, "
        f"by: {rng.uniform(-0.15, 0.15, 3).round(3).tolist()}}}\n"
        for _ in range(4)
    ]
    if volume == "nurbs":
        moves.append("  - weight: {at: [1, 1, 1], value: 2.5}\n")
    points = [degree + int(rng.integers(1, 3)) for degree in degrees]
    text = f"volume: {volume}\ndegree: {list(degrees)}\npoints: {points}\nedits:\n" + "".join(moves)
    mesh, lattice = job(text, *ball(1))
    plan = prepare(mesh, lattice)
    result = plan.deform(lattice, tolerance=tolerance, max_degree=max_degree)
    assert result.max_error <= tolerance
    exact = plan.deform(lattice, check=False)
    assert points_off(exact.brep, result.brep) <= result.max_error
    report = result.write(tmp_path / "any.step").report
    require_sound(tmp_path / "any.step")
    if max_degree is not None:
        names = [name for name in report["degrees"] if name != "plane"]
        assert max((int(name.split("x")[1]) for name in names), default=0) <= max_degree


def test_the_command_line(job, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job(LATTICE, *ball(0))
    files = ("mesh.obj", "lattice.yaml")
    options = ["--tolerance", "1e-3", "--max-degree", "3", "--report", "r.json", "--quiet"]
    done = ffd("deform", *files, "-o", "o.step", *options)
    report = json.loads((tmp_path / "r.json").read_text())
    assert sum(report["degrees"].values()) == 8
    assert max(name[-1] for name in report["degrees"]) == "3"
    assert not report["exact"]
    assert f"within {report['max_error']:.2e} mm of the exact result" in done.stdout
    assert "deformed within" in (tmp_path / "o.step").read_text()[:2000]
    ffd("verify", "o.step", *files, "--against", "r.json")
    wrong = ffd("deform", *files, "-o", "p.step", "--max-degree", "3", status=2)
    assert "--max-degree needs --tolerance" in wrong.stderr
    out_of_reach = ("--tolerance", "1e-15", "--max-degree", "3")
    failed = ffd("deform", *files, "-o", "p.step", *out_of_reach, status=1)
    assert "degree 3 does not come within 1e-15" in failed.stderr
    assert not (tmp_path / "p.step").exists()


def test_python_refuses_what_makes_no_sense(job):
    mesh, lattice = job(LATTICE)
    with pytest.raises(FfdError, match="needs a tolerance"):
        deform(mesh, lattice, max_degree=3)
    with pytest.raises(FfdError, match="above 0"):
        prepare(mesh, lattice).deform(lattice, tolerance=0.0)


def test_a_lattice_at_rest_stays_exact(job):
    mesh, lattice = job("degree: [3, 3, 3]\npoints: [5, 5, 5]\n")
    report = deform(mesh, lattice, tolerance=1e-3).report
    assert report["exact"]
    assert report["max_error"] == 0
    assert set(report["degrees"]) == {"plane"}
