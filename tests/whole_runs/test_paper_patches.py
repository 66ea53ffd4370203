"""`--patches paper`: the frames and degrees of Feng 2002, Table 1, in files of every format."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from ffdcli import deform, prepare
from ffdcli.brep.evaluate.lookup import model_of_brep, model_of_read
from ffdcli.brep.occ.reading.read import read_cad, record_of
from ffdcli.cli import main
from ffdcli.verify.file import verify_file
from support.jobs import CUBE, written
from support.surface_models import turn

# Boxes that together have the seven normals of Table 1.
TURNS = {
    "three axes": np.eye(3),
    "about u": turn([1, 0, 0], 0.37),
    "about v": turn([0, 1, 0], 0.93),
    "about w": turn([0, 0, 1], 0.61),
    "general": turn([0.3, -0.5, 0.8], 0.83),
}
# The axis of highest degree decides the frame of general planes.
DEGREES = [(1, 2, 3), (3, 1, 2), (2, 3, 1), (3, 3, 3)]
FORMATS = ("out.step", "out.igs", "out.brep")


def table_1(normal, degrees):
    """The row of the paper's table: s, t and the degrees, for a unit normal."""
    x, y, z = np.where(np.abs(normal) < 1e-12, 0, normal)
    ku, kv, kw = degrees
    match bool(x), bool(y), bool(z):
        case (True, False, False):
            return (0, 1, 0), (0, 0, x), (kv, kw)
        case (False, True, False):
            return (0, 0, 1), (y, 0, 0), (kw, ku)
        case (False, False, True):
            return (1, 0, 0), (0, z, 0), (ku, kv)
        case (False, True, True):
            return (1, 0, 0), (0, z, -y), (ku, kv + kw)
        case (True, False, True):
            # The paper's t, (n_z, 0, -n_x), is -n × s: its sign alone differs from the other rows.
            return (0, 1, 0), (-z, 0, x), (kv, ku + kw)
        case (True, True, False):
            return (0, 0, 1), (y, -x, 0), (kw, ku + kv)
    if ku >= kv and ku >= kw:
        s, low = (0, -z, y), kv + kw
    elif kv >= ku and kv >= kw:
        s, low = (z, 0, -x), ku + kw
    else:
        s, low = (-y, x, 0), ku + kv
    s = np.array(s) / np.linalg.norm(s)
    return s, np.cross((x, y, z), s), (low, ku + kv + kw)


def job_text(degrees, *, rational=False):
    counts = [k + 3 for k in degrees]
    text = f"volume: {'nurbs' if rational else 'bspline'}\ndegree: {list(degrees)}\n"
    text += f"points: {counts}\nbox: {{min: [-1, -1, -1], max: [1, 1, 1]}}\nedits:\n"
    text += "  - twist: {axis: w, angle: 40}\n  - bend: {axis: u, toward: w, angle: 30}\n"
    if rational:
        text += "  - weight: {at: [1, 1, 1], value: 3}\n  - weight: {at: [2, 1, 2], value: 0.4}\n"
    return text


@pytest.fixture
def bent(job):
    def make(name, degrees, **options):
        points = (CUBE - 0.5) @ TURNS[name].T * [1.0, 0.9, 0.8]
        return job(job_text(degrees, **options), points)

    return make


def surfaces_of(path):
    """The degrees of the surfaces in a STEP or IGES file, from its text."""
    text = path.read_text()
    if path.suffix == ".step":
        found = re.findall(
            r"B_SPLINE_SURFACE(?:_WITH_KNOTS)?\s*\((?:\s*'[^']*'\s*,)?(\d+),(\d+),", text
        )
        return Counter((int(u), int(v)) for u, v in found)
    lines = [line[:64] for line in text.splitlines() if len(line) > 72 and line[72] == "P"]
    data = "".join(line.rstrip() if line.rstrip().endswith(",") else line for line in lines)
    found = re.findall(r"(?:^|;)\s*128,(\d+),(\d+),(\d+),(\d+),", data.replace(" ", ""))
    return Counter((int(m1), int(m2)) for _, _, m1, m2 in found)


def direct(volume, points):
    """Images of points by scipy alone."""
    spline = NdBSpline(volume.knots, volume.net, volume.degrees)
    found = spline(points)
    return found[:, :3] / found[:, 3:] if found.shape[1] == 4 else found


def check_surfaces(record, plan, merged, lattice, size):
    """Surfaces read from a file against direct evaluation and against the merged surfaces."""
    volume, parts = lattice.volume, plan.geometry.parts
    model, other = model_of_read(record), model_of_brep(merged.brep)
    merged_parts = prepare(merged.origin.checked.mesh, lattice).geometry.parts
    # The merged face of each triangle of the mesh, and its frame.
    face_of_triangle = {}
    for triangle, region in zip(
        merged_parts.pieces.triangle.tolist(), merged_parts.region.tolist(), strict=True
    ):
        face_of_triangle.setdefault(triangle, []).append(region)
    rng = np.random.default_rng(0)
    for face in range(record.face_count):
        piece = int(np.flatnonzero(parts.region == face)[0])
        run = parts.pieces.starts[piece : piece + 2]
        corners = parts.pieces.vertices[parts.pieces.corners[run[0] : run[1]], 0]
        points = rng.dirichlet(np.ones(len(corners)), 6) @ corners
        patch = parts.patch[face]
        members = parts.pieces.corners[
            np.isin(parts.pieces.owner, np.flatnonzero(parts.patch[parts.region] == patch))
        ]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal /= np.linalg.norm(normal)
        s, t, degrees = table_1(normal, volume.degrees)
        frame = np.array([s, t], dtype=float)
        place = points @ frame.T - (parts.pieces.vertices[members, 0] @ frame.T).min(axis=0)
        found, _ = model.on_faces(np.full(len(points), face), place)
        exact = volume.frame.to_model(direct(volume, points))
        assert np.abs(found - exact).max() <= 1e-11 * size
        yield degrees
        for region in face_of_triangle[int(parts.pieces.triangle[piece])]:
            inside = _holds(merged_parts, region, points)
            if inside.any():
                axes = merged_parts.graphs.axes[region, 1:]
                there, _ = other.on_faces(np.full(inside.sum(), region), points[inside][:, axes])
                assert np.abs(there - found[inside]).max() <= 1e-11 * size


def _holds(parts, region, points):
    return ((points >= parts.low[region] + 1e-9) & (points <= parts.high[region] - 1e-9)).any(
        axis=1
    ) & ((points >= parts.low[region] - 1e-9) & (points <= parts.high[region] + 1e-9)).all(axis=1)


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("name", TURNS)
def test_files_hold_the_surfaces_of_table_1(bent, tmp_path, name, degrees):
    mesh, lattice = bent(name, degrees)
    plan, merged = prepare(mesh, lattice, patches="paper"), deform(mesh, lattice)
    result = plan.deform(lattice)
    assert result.report["exact"]
    assert 0 < result.report["interpolation_error"] < 1e-11 * mesh.size
    for file in FORMATS[:1] if degrees != (1, 2, 3) else FORMATS:
        verdict = written(result, tmp_path / file, mesh, lattice)
        assert verdict.max_deviation <= 1e-11 * mesh.size
        record = record_of(read_cad(tmp_path / file))
        expected = list(check_surfaces(record, plan, merged, lattice, mesh.size))
        of_surface = {}
        for batch in record.surfaces:
            of_surface |= dict.fromkeys(batch.surfaces.tolist(), batch.degrees)
        assert [of_surface[number] for number in record.face_surface.tolist()] == expected
        if file != "out.brep":
            assert set(surfaces_of(tmp_path / file)) == set(expected)


@pytest.mark.parametrize("name", ["about v", "general"])
@pytest.mark.parametrize("file", FORMATS)
def test_rational_volumes_are_interpolated_in_homogeneous_points(bent, tmp_path, name, file):
    mesh, lattice = bent(name, (2, 3, 2), rational=True)
    plan, merged = prepare(mesh, lattice, patches="paper"), deform(mesh, lattice)
    result = plan.deform(lattice)
    assert result.report["rational"]
    verdict = written(result, tmp_path / file, mesh, lattice)
    assert verdict.max_deviation <= 1e-11 * mesh.size
    record = record_of(read_cad(tmp_path / file))
    assert any(batch.poles.shape[-1] == 4 for batch in record.surfaces)
    list(check_surfaces(record, plan, merged, lattice, mesh.size))


def test_matrices_of_a_plan_give_the_same_surfaces(bent):
    mesh, lattice = bent("general", (3, 2, 3))
    plan = prepare(mesh, lattice, patches="paper")
    plain, quick = plan.deform(lattice).brep, plan.with_matrices().deform(lattice).brep
    for a, b in zip(plain.surfaces, quick.surfaces, strict=True):
        np.testing.assert_allclose(a.poles, b.poles, rtol=0, atol=1e-11)


def test_coplanar_sub_polygons_of_a_knot_box_share_a_surface(job):
    """A comb: its teeth's tops are one plane in each knot box."""
    text = "degree: [2, 2, 2]\npoints: [4, 4, 4]\nedits:\n  - twist: {axis: w, angle: 30}\n"
    teeth = [CUBE * [0.1, 1, 1] + [x, 0, 0] for x in (0.0, 0.2, 0.4, 0.6, 0.8)]
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    triangles = np.concatenate([np.array(faces) + 8 * i for i in range(len(teeth))])
    mesh, lattice = job(text, np.concatenate(teeth), triangles)
    brep = deform(mesh, lattice, patches="paper").brep
    assert brep.surface_count < brep.face_count
    assert brep.surface_count == deform(mesh, lattice, patches="bezier").brep.surface_count


def test_a_reduced_file_verifies(bent, tmp_path):
    mesh, lattice = bent("general", (3, 3, 3))
    result = deform(mesh, lattice, patches="paper", tolerance=1e-4)
    assert (
        result.report["control_points"]
        < deform(mesh, lattice, patches="paper").report["control_points"]
    )
    result.write(tmp_path / "out.step")
    verdict = verify_file(
        tmp_path / "out.step", mesh, lattice, tolerance=1e-4, expected_error=result.max_error
    )
    assert verdict.passed, verdict.reasons


def test_deform_then_verify_against_its_report(bent, tmp_path, capsys):
    bent("general", (2, 2, 2))
    out, report = tmp_path / "out.step", tmp_path / "report.json"
    files = [str(tmp_path / "mesh.obj"), str(tmp_path / "lattice.yaml")]
    for command in (
        ["deform", *files, "-o", str(out), "--patches", "paper", "--report", str(report)],
        ["verify", str(out), *files, "--against", str(report)],
    ):
        with pytest.raises(SystemExit) as end:
            main(command)
        assert end.value.code == 0
    printed = capsys.readouterr().out
    assert "interpolation adds rounding errors of at most" in printed
    assert "passed" in printed
