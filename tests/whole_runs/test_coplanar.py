"""Thresholds of coplanarity: the default is exact, looser ones are stated and bounded."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from ffdcli import Coplanar, deform
from ffdcli.batch.jobs import list_jobs
from ffdcli.batch.single_job import run_job
from ffdcli.cli import main
from ffdcli.errors import FfdError
from ffdcli.surface.planes import find_planes
from support.jobs import written

NOISE = 1e-4
LATTICE = "degree: [2, 2, 2]\npoints: [4, 4, 4]\nedits:\n  - twist: {axis: w, angle: 25}\n"


def rough_box():
    """A cube whose top, of 32 triangles, is off its plane by up to the noise."""
    box = trimesh.creation.box().subdivide().subdivide()
    points, faces = np.array(box.vertices), np.array(box.faces)
    inner = (points[:, 2] > 0.49) & (np.abs(points[:, :2]).max(axis=1) < 0.49)
    points[inner, 2] += np.random.default_rng(0).uniform(-NOISE, NOISE, inner.sum())
    return points, faces


@pytest.fixture
def rough(job):
    return job(LATTICE, *rough_box())


def test_by_default_every_facet_off_the_plane_is_its_own_face(rough):
    result = deform(*rough)
    assert result.brep.face_count > 6
    assert result.report["exact"]
    assert not result.report["flattened"]


@pytest.mark.parametrize(
    ("patches", "name"), [("merged", "out.step"), ("bezier", "out.igs"), ("paper", "out.brep")]
)
def test_a_looser_distance_is_stated_and_verified_by_its_bound(rough, tmp_path, patches, name):
    mesh, _ = rough
    limits = Coplanar(distance=2 * NOISE, angle=1)
    result = deform(*rough, patches=patches, coplanar=limits)
    report = result.report
    assert report["flattened"]
    assert not report["exact"]
    # The surface is off the mesh by no more than is stated, and by something.
    assert 0.2 * NOISE < report["plane_deviation"] < 4 * NOISE
    assert report["max_error"] == 0
    verdict = written(result, tmp_path / name, *rough)
    assert verdict.max_deviation <= report["plane_deviation"]
    assert verdict.max_deviation > 1e-7 * mesh.size
    if patches == "merged":
        assert result.brep.face_count == 6
    assert "exactly" not in (tmp_path / name).read_text(errors="ignore")


def test_the_papers_thresholds_leave_this_mesh_as_it_is(rough):
    """1.1e-6 and 2.2e-8 of a cosine, which is 0.012 degrees (Feng 2002, section 3.3.2)."""
    assert np.degrees(np.arccos(1 - 2.2e-8)) == pytest.approx(0.012, rel=1e-2)
    plain = deform(*rough)
    paper = deform(*rough, coplanar=Coplanar(1.1e-6, 0.012))
    assert paper.brep.face_count == plain.brep.face_count
    assert paper.exact


def test_the_angle_keeps_low_walls_apart():
    """Steps lower than the distance: their walls are at 90 degrees, their treads in one plane."""
    high = 1e-3
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, high], [1, 1, high],
         [2, 0, high], [2, 1, high]], dtype=float,
    )  # fmt: skip
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2], [4, 6, 7], [4, 7, 5]])
    polygon = np.array([0, 0, 1, 1, 2, 2])
    groups = find_planes(points, triangles, polygon, 1e-9, Coplanar(0.1, 5)).group
    assert len(set(groups.tolist())) == 3


@pytest.mark.parametrize(("angle", "count"), [(1.0, 2), (3.0, 1)])
def test_polygons_are_compared_with_the_plane_of_their_group(angle, count):
    """A ridge of 4 degrees: each side is at 2 degrees to the plane of both."""
    rise = np.tan(np.radians(2))
    points = np.array([[0, 0, 0], [1, 0, rise], [1, 1, rise], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    polygon = np.array([0, 0, 1, 1])
    groups = find_planes(points, triangles, polygon, 1e-9, Coplanar(0.1, angle)).group
    assert len(set(groups.tolist())) == count


@pytest.mark.parametrize(
    "values", [(0.0, 1), (-1.0, 1), (np.inf, 1), (0.1, None), (None, 0), (None, 31)]
)
def test_bad_thresholds_are_refused(values):
    with pytest.raises(FfdError, match="coplanar"):
        Coplanar(*values)


def test_command_and_jobs_file_take_the_thresholds(rough, tmp_path, capsys):
    files = [str(tmp_path / "mesh.obj"), str(tmp_path / "lattice.yaml")]
    options = ["--coplanar-distance", str(2 * NOISE), "--coplanar-angle", "1"]
    with pytest.raises(SystemExit) as end:
        main(["deform", *files, "-o", str(tmp_path / "out.step"), *options])
    assert end.value.code == 0
    printed = capsys.readouterr().out
    assert "flattened: planes are shared within the coplanar distance" in printed
    assert "6 faces" in printed
    with pytest.raises(SystemExit) as end:
        main(["deform", *files, "-o", str(tmp_path / "out.step"), *options[:2]])
    assert end.value.code == 2
    (tmp_path / "jobs.yaml").write_text(
        "version: 1\nverify: true\noutput: job.step\njobs:\n"
        "  - mesh: mesh.obj\n    lattice: lattice.yaml\n"
        f"    options: {{coplanar: {{distance: {2 * NOISE}, angle: 1}}}}\n"
    )
    (job,) = list_jobs(tmp_path / "jobs.yaml")
    record = run_job(job)
    assert record["status"] == "verified"
    assert record["report"]["faces"] == 6
