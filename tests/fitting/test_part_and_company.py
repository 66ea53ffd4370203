"""Inverted lattices over part of a model, and beside other lattices: fitted, joined, verified."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.interpolate import BSpline
from scipy.optimize import root
from trimesh.intersections import slice_faces_plane

from ffdcli import deform, deform_mesh, prepare, read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.fitting.parametrization import parametrize
from ffdcli.fitting.spread import Surface
from ffdcli.mesh import triangles
from ffdcli.verify.file import allowed_deviation, verify_file
from ffdcli.verify.regions import fit_bounds

# Inverted lattices over the ends and the middle of a bar from -6 to 6, and regular ones.
INVERSE = """\
  - volume: tspline
    box: {{min: [{low}, -3, -3], max: [{high}, 3, 3]}}
    octree: {{depth: 2, embedding: inverse}}
    edits: [{{move: {{at: {{near: [{at}, 0, 1]}}, by: [0, 0.4, 1.2]}}}}]
"""
RIGHT = INVERSE.format(low=-1, high=7, at=3.5)
BSPLINE = """\
  - box: {{min: [{low}, -3, -3], max: [{high}, 3, 3]}}
    points: [7, 4, 4]
    edits: [{{move: {{at: [3, 2, 2], by: [0, 0, 0.5]}}}}]
"""
CASES = {
    "part c0": RIGHT + "    border: c0\n",
    "part c1": RIGHT + "    border: c1\n",
    "disjoint": BSPLINE.format(low=-5, high=-2) + RIGHT,
    "touching": RIGHT + BSPLINE.format(low=-5, high=-1),
    "two": INVERSE.format(low=-7, high=-1, at=-4) + RIGHT,
}
TOLERANCE = 1e-2


@dataclass
class Run:
    folder: Any
    mesh: Any
    lattice: Any
    result: Any

    @property
    def inverted(self):
        return [n for n, one in enumerate(self.lattice.maps) if one.needs_fit]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bar")
    trimesh.creation.box((12, 2, 2)).subdivide().subdivide().export(folder / "bar.obj")
    return folder


@pytest.fixture(scope="module")
def mesh(folder):
    return read_mesh(folder / "bar.obj")


def lattice_of(folder, mesh, entries):
    path = folder / "l.yaml"
    path.write_text("version: 1\nlattices:\n" + entries)
    return read_lattice(path, mesh)


@pytest.fixture(scope="module", params=CASES)
def run(request, folder, mesh):
    lattice = lattice_of(folder, mesh, CASES[request.param])
    return Run(folder, mesh, lattice, deform(mesh, lattice, fit_tolerance=TOLERANCE))


def by_definition(volume, points, place):
    """``x + P1(u) - P0(u)`` with ``P0(u) = x``, from scipy's B-splines and its solver.

    Outside the image of the box, at which the solver ends beyond the box, points stay.
    """
    knots = [
        volume.origin[axis] + of_axis * volume.unit[axis]
        for axis, of_axis in enumerate(volume.functions.knots)
    ]
    splines = [[BSpline.basis_element(row, extrapolate=False) for row in rows] for rows in knots]

    def quotient(net, u):
        factors = [
            [0.0 if np.isnan(value := float(one(u[axis]))) else value for one in splines[axis]]
            for axis in range(3)
        ]
        row = np.prod(factors, axis=0) * volume.rest_weights
        return row @ net / row.sum()

    start = np.clip(place, *volume.box)
    found = root(lambda u: quotient(volume.rest_points, u) - place, start, tol=1e-13)
    u = found.x
    if not found.success or np.any(u < volume.box[0]) or np.any(u > volume.box[1]):
        return place
    return place + quotient(points, u) - quotient(volume.rest_points, u)


def places_on(mesh, low, high, count):
    """Points of the mesh's surface between two values of x."""
    corners, _ = triangles(mesh)
    random = np.random.default_rng(7)
    share = random.dirichlet([1, 1, 1], 40 * count)
    points = np.einsum(
        "nk,nkx->nx", share, mesh.vertices[corners[random.integers(len(corners), size=40 * count)]]
    )
    return points[(points[:, 0] > low) & (points[:, 0] < high)][:count]


SLOW = {"part c1", "disjoint", "two"}
MARKED = [pytest.param(name, marks=pytest.mark.sweep) if name in SLOW else name for name in CASES]


@pytest.mark.parametrize("run", MARKED, indirect=True)
def test_it_is_a_closed_solid_within_its_bound(run, tmp_path):
    report = run.result.report
    assert (report["solids"], report["watertight"], report["exact"]) == (1, True, False)
    assert 0 < report["max_error"] <= TOLERANCE
    run.result.write(tmp_path / "out.step")
    verdict = verify_file(
        tmp_path / "out.step",
        run.mesh,
        run.lattice,
        tolerance=allowed_deviation(report, "report", run.mesh),
        expected_error=report["max_error"],
        bounds=fit_bounds(report),
    )
    assert verdict.passed, verdict.reasons
    assert verdict.valid
    assert verdict.watertight


@pytest.mark.sweep
def test_each_lattice_is_judged_by_its_own_bound(folder, mesh, tmp_path):
    """An exact lattice that is wrong by less than the fit beside it is off."""
    lattice = lattice_of(folder, mesh, CASES["touching"])
    wrong = lattice_of(folder, mesh, CASES["touching"].replace("[0, 0, 0.5]", "[0, 0, 0.502]"))
    made = deform(mesh, wrong, fit_tolerance=TOLERANCE).write(tmp_path / "wrong.step")
    judged = {"tolerance": made.max_error, "expected_error": made.max_error}
    assert verify_file(tmp_path / "wrong.step", mesh, lattice, **judged).passed
    bounds = fit_bounds(made.report)
    assert bounds == {0: made.max_error}
    verdict = verify_file(tmp_path / "wrong.step", mesh, lattice, bounds=bounds, **judged)
    assert not verdict.passed
    (reason,) = verdict.reasons
    assert "in the box of lattices[1] are not on the file's faces" in reason
    assert verify_file(tmp_path / "wrong.step", mesh, wrong, bounds=bounds, **judged).passed


def test_the_report_says_which_were_fitted_and_how_well(run):
    fit = run.result.report["fit"]
    assert [each["lattice"] for each in fit["lattices"]] == run.inverted
    assert fit["bound"] == max(each["bound"] for each in fit["lattices"])
    assert fit["samples"] == sum(each["samples"] for each in fit["lattices"])
    for each in fit["lattices"]:
        solved = each["parametrization"]
        assert each["samples"] < solved["points"]
        assert 0 < solved["iterations"] <= 100
        assert solved["seconds"] > 0


def test_deviations_from_the_definition_are_within_the_bound(run):
    """The definition is evaluated by scipy; the fit and the lattice's own map are near it."""
    moved = 0.0
    for each in run.result.fitted.members:
        member = run.lattice.members[each.number]
        volume, frame = member.map, member.map.frame
        low, high = frame.to_model(volume.box)[:, 0]
        places = np.concatenate(
            [places_on(run.mesh, low, low + 0.5, 6), places_on(run.mesh, low, high, 20)]
        )
        local = frame.to_local(places)
        true = np.array([by_definition(volume, member.points, place) for place in local])
        assert np.abs(volume.evaluate(local) - true).max() < 1e-9
        fitted = run.result.fitted.lattice.maps[each.number].evaluate(local)
        assert np.linalg.norm(fitted - true, axis=1).max() <= each.fit.bound
        moved = max(moved, float(np.abs(true - local).max()))
    assert moved > 0.05


def test_nothing_outside_moves_at_all(run):
    """Vertices outside all boxes, and faces between them, are those of the mesh."""
    boxes = [one.frame.to_model(one.box)[:, 0] for one in run.lattice.maps]

    def outside(x):
        return np.all([(x <= low) | (x >= high) for low, high in boxes], axis=0)

    rest, points = run.result.undeformed.rest, run.result.brep.points
    still = outside(rest[:, 0])
    assert still.sum() >= 4
    assert np.array_equal(points[still], rest[still])
    assert not np.array_equal(points, rest)
    if all(low > -6 for low, _ in boxes):
        assert run.result.report["degrees"]["plane"] >= 5
    # The fit vanishes at locked sides and beyond them to the last bit.
    for each in run.result.fitted.members:
        member = run.result.fitted.lattice.members[each.number]
        low, high = member.map.box
        for side in member.crossed:
            axis, upper = "uvw".index(side[0]), side.endswith("max")
            at = np.random.default_rng(1).uniform(low, high, (200, 3))
            at[:, axis] = (low, high)[upper][axis]
            assert np.abs(member.map.evaluate(at) - at).max() < 1e-15
            slopes = member.map.jacobian(at) - np.eye(3)
            assert np.abs(slopes).max() < 1e-12


def test_lattices_that_need_no_fit_stay_exact(run):
    for number, one in enumerate(run.lattice.maps):
        if number not in run.inverted:
            assert run.result.fitted.lattice.maps[number] is one


def test_the_border_makes_no_difference(folder, mesh):
    """A tspline joins with C2, whichever is asked for."""
    first, second = (lattice_of(folder, mesh, CASES[f"part {name}"]) for name in ("c0", "c1"))
    assert first.crossed == second.crossed == ("u_min",)
    assert np.array_equal(first.locked, second.locked)


def test_a_plan_serves_other_edits_of_all(folder, mesh):
    lattice = lattice_of(folder, mesh, CASES["two"])
    plan = prepare(mesh, lattice, fit_tolerance=TOLERANCE)
    half = plan.deform(lattice.scaled(0.5), check=False)
    assert 0 < half.max_error < plan.deform(lattice, check=False).max_error
    other = lattice_of(folder, mesh, CASES["touching"])
    with pytest.raises(LatticeError, match="prepared for other"):
        plan.deform(other)


def test_drags_near_the_join_meet_their_targets(folder, mesh):
    drag = "    edits: [{drag: {pairs: [{from: [2, 0, 1], by: [0, 0, 1]}]}}]\n"
    entry = RIGHT[: RIGHT.index("    edits")] + drag
    lattice = lattice_of(folder, mesh, entry)
    (volume,) = lattice.maps
    source = volume.frame.to_local(np.array([[2.0, 0.0, 1.0]]))
    assert np.abs(volume.evaluate(source) - source - [0, 0, 1]).max() < 1e-9
    assert not lattice.members[0].locked[np.any(lattice.points != volume.rest_points, axis=1)].any()
    with pytest.raises(LatticeError, match="has no parameters"):
        lattice_of(folder, mesh, entry.replace("from: [2,", "from: [-0.95,"))


def test_a_torn_deformation_is_refused_by_number_place_and_side(folder, mesh):
    """A box that just holds the model: its ends are beyond the image of the box."""
    tight = "  - volume: tspline\n    box: {min: [-6, -3, -3], max: [6, 3, 3]}\n"
    tight += "    octree: {depth: 2, embedding: inverse}\n"
    at_rest = deform(mesh, lattice_of(folder, mesh, tight))
    assert at_rest.report["exact"]
    edit = "    edits: [{move: {at: {near: [%s]}, by: [1, 0, 0]}}]\n"
    lattice = lattice_of(folder, mesh, tight + edit % "6, 0, 0")
    for make in (deform, lambda *each: deform_mesh(*each, mode="vertices")):
        with pytest.raises(LatticeError) as caught:
            make(mesh, lattice)
        assert "of 98 sampled points of the mesh have no parameters" in caught.value.message
        assert "control points of the side u_max" in caught.value.message
        assert "the first at (6, " in caught.value.message
        assert caught.value.key == "lattices[0].octree.embedding"
        assert "displacement" in caught.value.hint
    inside = lattice_of(folder, mesh, tight + edit % "0, 0, 1")
    assert deform(mesh, inside, fit_tolerance=TOLERANCE).report["watertight"]


def test_locked_control_points_are_named_with_a_remedy_that_an_octree_has(folder, mesh):
    edit = "    edits: [{move: {at: {near: [0, 0, 1]}, by: [0, 0, 1]}}]\n"
    entry = RIGHT[: RIGHT.index("    edits")] + edit
    with pytest.raises(LatticeError, match="reaches out of the lattice box at its side u_min") as e:
        lattice_of(folder, mesh, entry)
    assert "smaller cells" in e.value.hint
    assert "border" not in e.value.hint


@pytest.mark.parametrize("seed", range(4))
def test_surfaces_are_clipped_to_the_cube(seed):
    random = np.random.default_rng(seed)
    corners = random.uniform(-0.6, 1.6, (40, 3, 3))
    clipped = Surface.clipped(corners).triangles
    assert clipped.min() >= 0
    assert clipped.max() <= 1
    points, faces = corners.reshape(-1, 3), np.arange(120).reshape(-1, 3)
    for normal in np.concatenate([np.eye(3), -np.eye(3)]):
        origin = np.full(3, float(normal.min() < 0))
        points, faces = slice_faces_plane(points, faces, normal, origin)[:2]
    area = np.linalg.norm(np.cross(*np.moveaxis(clipped[:, 1:] - clipped[:, :1], 1, 0)), axis=1) / 2
    assert area.sum() == pytest.approx(trimesh.Trimesh(points, faces).area, rel=1e-7)
    assert len(Surface.clipped(corners + 5).triangles) == 0


def test_meshes_are_deformed_by_the_lattice_itself(folder, mesh):
    lattice = lattice_of(folder, mesh, CASES["touching"])
    made = deform_mesh(mesh, lattice, mode="vertices")
    assert made.report["parametrization"]["points"] == parametrize(mesh, lattice).points > 0
    assert made.report["jacobian"]["injective"] == "unproved"
    assert any("only its vertices" in warning for warning in made.report["warnings"])
    still = (made.rest[:, 0] <= -5) | (made.rest[:, 0] == -1)
    assert np.array_equal(made.points[still], made.rest[still])
    assert not np.array_equal(made.points, made.rest)
