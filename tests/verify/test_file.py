"""`ffd verify` on files: passes what is right and fails each fault it must fail."""

import json
from dataclasses import replace

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.assemble import reverse_shells
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import CheckError
from ffdcli.verify.file import verify_file
from support.commands import ffd
from support.jobs import CUBE, EDITS

LATTICE = "degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + EDITS


@pytest.fixture
def made(job, tmp_path):
    mesh, lattice = job(LATTICE, CUBE * [3, 2, 1])
    result = deform(mesh, lattice)
    path = tmp_path / "out.step"

    def judge(brep, mesh=mesh, lattice=lattice):
        write_cad(build_shape(brep), path)
        return verify_file(path, mesh, lattice)

    judge.brep, judge.mesh, judge.lattice = result.brep, mesh, lattice
    return judge


def without_face(brep, face):
    """The record with one face left out; its shell stays where it is."""
    keep = np.arange(brep.face_count) != face
    loops = np.flatnonzero(np.repeat(keep, np.diff(brep.face_loops)))
    spans = [np.arange(brep.loop_coedges[k], brep.loop_coedges[k + 1]) for k in loops]
    coedges = np.concatenate(spans)
    return replace(
        brep,
        face_surface=brep.face_surface[keep],
        face_reversed=brep.face_reversed[keep],
        face_shell=brep.face_shell[keep],
        face_loops=np.concatenate([[0], np.cumsum(np.diff(brep.face_loops)[keep])]),
        loop_coedges=np.concatenate([[0], np.cumsum([len(span) for span in spans])]),
        coedge_edge=brep.coedge_edge[coedges],
        coedge_forward=brep.coedge_forward[coedges],
        pcurves=brep.pcurves[coedges],
    )


def flipped_face(brep, face):
    """The record with one face turned over."""
    alone = replace(
        brep,
        face_shell=(np.arange(brep.face_count) == face).astype(np.int64),
        shell_closed=np.array([True, True]),
    )
    turned = reverse_shells(alone, np.array([False, True]))
    return replace(turned, face_shell=brep.face_shell, shell_closed=brep.shell_closed)


def test_the_right_file_passes(made):
    verdict = made(made.brep)
    assert verdict.passed, verdict.reasons
    assert verdict.max_deviation < 1e-12 * made.mesh.size
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-12)


def test_another_mesh_fails(made):
    mesh = replace(made.mesh, vertices=made.mesh.vertices * [1, 1, 1.001])
    verdict = made(made.brep, mesh=mesh)
    assert not verdict.passed
    assert verdict.max_deviation > 1e-4 * mesh.size


def test_another_lattice_fails(made):
    verdict = made(made.brep, lattice=made.lattice.scaled(0.999))
    assert not verdict.passed
    assert any("deformed mesh" in reason for reason in verdict.reasons)


@pytest.mark.parametrize("face", [0, 4])
def test_a_missing_face_fails(made, face):
    verdict = made(without_face(made.brep, face))
    assert not verdict.passed
    assert not verdict.watertight
    assert any("missing" in reason for reason in verdict.reasons)


@pytest.mark.parametrize("face", [1, 5])
def test_a_flipped_face_fails(made, face):
    verdict = made(flipped_face(made.brep, face))
    assert not verdict.passed
    assert any("flipped" in reason or "turned" in reason for reason in verdict.reasons)


def test_an_inside_out_solid_fails(made):
    inverted = reverse_shells(made.brep, np.array([True]))
    verdict = made(inverted)
    assert not verdict.passed
    assert verdict.volume < 0


def test_a_moved_pole_fails(made):
    """So that the face moves by 1e-5 of the size, ten times the tolerance, and nothing else."""
    brep = made.brep
    batch = brep.surfaces[0]
    poles = batch.poles.copy()
    middle = tuple(n // 2 for n in poles.shape[1:3])
    around = np.cross(
        poles[0, middle[0] + 1, middle[1]] - poles[0, middle[0] - 1, middle[1]],
        poles[0, middle[0], middle[1] + 1] - poles[0, middle[0], middle[1] - 1],
    )
    # An inner basis function of bi-degree 3 x 3 is nowhere below a tenth at its own peak.
    poles[0, middle[0], middle[1]] += 4e-5 * made.mesh.size * around / np.linalg.norm(around)
    moved = replace(brep, surfaces=(replace(batch, poles=poles), *brep.surfaces[1:]))
    verdict = made(moved)
    assert not verdict.passed
    assert 5e-6 * made.mesh.size < verdict.max_deviation < 4e-5 * made.mesh.size


def test_the_command_says_why_and_exits_with_3(made, tmp_path):
    made(without_face(made.brep, 2))
    files = [tmp_path / name for name in ("out.step", "mesh.obj", "lattice.yaml")]
    run = ffd("verify", *files, "--json", status=3)
    report = json.loads(run.stdout)
    assert report["passed"] is False
    assert "failed: " in run.stderr


def test_the_command_passes_against_its_own_report(job, tmp_path):
    mesh, _ = job(LATTICE)
    out, report = tmp_path / "out.step", tmp_path / "report.json"
    files = [mesh.source, tmp_path / "lattice.yaml"]
    ffd("deform", *files, "-o", out, "--report", report)
    assert "passed" in ffd("verify", out, *files, "--against", report).stdout


def test_another_unit_fails(made, tmp_path):
    write_cad(build_shape(made.brep), tmp_path / "inch.step", unit="inch")
    verdict = verify_file(tmp_path / "inch.step", made.mesh, made.lattice, unit="mm")
    assert verdict.reasons == ("the file is in inch, not in mm",)


@pytest.mark.parametrize("thickness", [1e-2, 1e-4])
def test_sheared_plates_of_linear_lattices_pass(job, tmp_path, thickness):
    """Kinks and slanting sides close together: seeds beside a point are mostly of wrong faces."""
    lattice = """\
degree: [1, 1, 1]
points: [4, 4, 4]
edits:
  - move: {at: [1, 1, 1], by: [0.1, 0, 0]}
  - move: {at: [":", ":", 2], by: [0.1, -0.1, 0]}
  - move: {at: [2, ":", 3], by: [-0.1, 0.1, 0]}
"""
    mesh, lattice = job(lattice, CUBE * [1, 1, thickness])
    path = tmp_path / "plate.brep"
    verdict = verify_file(deform(mesh, lattice).write(path).output, mesh, lattice)
    assert verdict.reasons == ()
    assert verdict.max_deviation < 1e-12


def test_edges_that_readers_of_step_take_for_points_are_refused(job, tmp_path):
    mesh, lattice = job("edits:\n  - twist: {axis: u, angle: 20}\n", CUBE * [1, 1, 5e-8])
    result = deform(mesh, lattice)
    with pytest.raises(CheckError, match=r"4 edges are shorter than 1e-07.*first near .*\.brep"):
        result.write(tmp_path / "out.step")
    assert list(tmp_path.glob("*.step*")) == []
    path = result.write(tmp_path / "out.brep").output
    assert verify_file(path, mesh, lattice).reasons == ()
