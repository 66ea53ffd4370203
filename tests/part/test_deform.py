"""Deformed parts against direct evaluation of the lattice at points that no fit has used."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.deformation import Deformation
from ffdcli.errors import CheckError, LatticeError
from ffdcli.part.curves import Line
from ffdcli.part.deform import deform_part
from ffdcli.part.new_geometry import EXACT, FITTED, UNCHANGED
from support.hand_parts import ball, cylinder, lattice_for, sheet

MODELS = {
    "cylinder": cylinder,
    "ball": ball,
    "sheet": sheet,
    "rational sheet": lambda: sheet(rational=True),
}
UPPER = {"box": {"min": [-3, -3, 2], "max": [3, 3, 6]}}


def distances(part, lattice, done, seed=1):
    """Largest distance of each face and edge from the deformation, at the same parameters."""
    images = Deformation.of(lattice, part.delta).images
    rng = np.random.default_rng(seed)
    faces, edges = [], []
    for old, new, plane, (low, high) in zip(
        part.surfaces, done.surfaces, done.planes, part.rectangles, strict=True
    ):
        at = low + rng.random((1500, 2)) * (high - low)
        if old.kind == "plane":
            at = at[np.linalg.norm(at, axis=1) <= high[0]]
        points = old.points(*at.T)
        if plane is not None:
            at = (points - plane.origin) @ np.stack([plane.x, plane.y], axis=1)
        new = old if new is None else new
        faces.append(np.linalg.norm(new.points(*at.T) - images(points), axis=1).max())
    for old, new, (low, high) in zip(part.curves, done.curves, part.edge_range, strict=True):
        at = rng.uniform(low, high, 500)
        if old is None:
            edges.append(0.0)
            continue
        new = old if new is None else new
        edges.append(np.linalg.norm(new.points(at) - images(old.points(at)), axis=1).max())
    return np.array(faces), np.array(edges)


@pytest.mark.parametrize("share", [1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("name", MODELS)
def test_faces_and_edges_keep_within_their_bounds(name, share):
    part = MODELS[name]()
    lattice = lattice_for(part)
    done = deform_part(part, lattice, share * part.size)
    rounding = 1e-12 * part.size
    faces, edges = distances(part, lattice, done)
    assert (faces <= done.face_bounds + rounding).all()
    assert (edges <= done.edge_bounds + rounding).all()
    assert done.max_error <= share * part.size
    assert done.edge_bounds.max() <= share * part.size / 2
    # The bound is no guess: what is found comes near it.
    fitted = done.face_kinds == FITTED
    assert fitted.any()
    assert (faces[fitted] > 0.2 * done.face_bounds[fitted]).all()


@pytest.mark.parametrize("volume", ["nurbs", "hierarchical"])
def test_other_volumes(volume):
    part = cylinder()
    keys = {"degree": [2, 2, 2], "amount": 0.1, "volume": volume}
    if volume == "hierarchical":
        keys |= {"octree": {"depth": 2}}
    lattice = lattice_for(part, **keys)
    done = deform_part(part, lattice, 1e-5 * part.size)
    faces, edges = distances(part, lattice, done)
    assert (faces <= done.face_bounds + 1e-12 * part.size).all()
    assert (edges <= done.edge_bounds + 1e-12 * part.size).all()


def test_a_seam_closes_to_the_bit_and_smoothly():
    part = cylinder()
    done = deform_part(part, lattice_for(part))
    side = done.surfaces[0]
    assert np.array_equal(side.poles[0], side.poles[-1])
    assert side.knots[0][0] == 0
    assert side.knots[0][-1] == 2 * np.pi
    v = np.linspace(0, 5, 40)
    first, last = (side.derivatives(np.full(40, u), v, 2) for u in (0.0, 2 * np.pi))
    for one, other in zip(first, last, strict=True):
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max()


def test_poles_are_points_to_the_bit():
    part = ball()
    lattice = lattice_for(part)
    done = deform_part(part, lattice)
    poles = done.surfaces[0].poles
    images = Deformation.of(lattice, part.delta).images(part.points)
    for row, image in ((poles[:, 0], images[0]), (poles[:, -1], images[1])):
        assert (row == row[0]).all()
        assert np.abs(row[0] - image).max() <= 1e-14 * part.size
    assert np.array_equal(poles[0], poles[-1])
    assert done.curves[0] is None
    assert done.curves[2] is None


def test_what_lies_beside_the_box_stays_as_it_was_read():
    part = cylinder()
    done = deform_part(part, lattice_for(part, **UPPER, border="c1"))
    assert done.face_kinds.tolist() == [FITTED, UNCHANGED, EXACT]
    assert done.surfaces[1] is None
    assert done.curves[0] is None
    assert done.edge_kinds.tolist() == [UNCHANGED, FITTED, EXACT]
    assert np.array_equal(done.points[0], part.points[0])
    assert not np.array_equal(done.points[1], part.points[1])


@pytest.mark.parametrize("border", ["c0", "c1", "c2"])
def test_the_border_of_the_box_is_a_knot(border):
    part = cylinder()
    lattice = lattice_for(part, **UPPER, border=border)
    done = deform_part(part, lattice, 1e-5 * part.size)
    knots = done.surfaces[0].knots[1]
    assert np.abs(knots - 2.0).min() <= 1e-12
    assert (np.abs(knots - 2.0) <= 1e-9).sum() == 3 - int(border[1])
    faces, _ = distances(part, lattice, done)
    assert (faces <= done.face_bounds + 1e-12 * part.size).all()


def test_round_planes_that_touch_the_box_are_exact():
    # Their rectangles reach beyond the box, since chords of the circle do not reach its extents.
    part = cylinder()
    wide = replace(
        part,
        rectangles=part.rectangles
        + np.array([[-0.01], [0.01]])
        * (np.array([each.kind == "plane" for each in part.surfaces])[:, None, None]),
    )
    lattice = lattice_for(wide)
    done = deform_part(wide, lattice)
    assert done.report["faces"] == {"unchanged": 0, "exact": 2, "fitted": 1}
    faces, _ = distances(part, lattice, done)
    assert faces[[each.kind == "plane" for each in part.surfaces]].max() <= 1e-13 * part.size


def test_a_lattice_at_rest_changes_nothing():
    for part in (cylinder(), ball(), sheet()):
        done = deform_part(part, lattice_for(part, amount=0.0))
        assert set(done.face_kinds) | set(done.edge_kinds) == {UNCHANGED}
        assert all(each is None for each in (*done.surfaces, *done.curves))
        assert np.array_equal(done.points, part.points)
        assert np.array_equal(done.edge_tolerance, part.edge_tolerance)
        assert np.array_equal(done.vertex_tolerance, part.vertex_tolerance)


def _affine(part, matrix, shift):
    lattice = lattice_for(part, amount=0.0)
    return lattice.with_net(lattice.points @ matrix.T + shift)


def test_a_motion_keeps_every_kind():
    angle = 0.4
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    part = cylinder()
    lattice = _affine(part, turn, np.array([1.0, 2, 3]))
    done = deform_part(part, lattice)
    assert [each.kind for each in done.surfaces] == ["cylinder", "plane", "plane"]
    assert [each.kind for each in done.curves] == ["circle", "circle", "line"]
    assert done.report["faces"] == {"unchanged": 0, "exact": 3, "fitted": 0}
    faces, edges = distances(part, lattice, done)
    assert max(faces.max(), edges.max()) <= 1e-13 * part.size
    assert done.max_error == 0


def test_an_affine_map_keeps_planes_and_splines():
    matrix = np.array([[1.2, 0.1, 0], [0, 0.8, 0.2], [0.1, 0, 1.1]])
    part = cylinder()
    done = deform_part(part, _affine(part, matrix, np.zeros(3)))
    assert [each.kind for each in done.surfaces] == ["b-spline", "plane", "plane"]
    assert done.face_kinds.tolist() == [FITTED, EXACT, EXACT]
    # The line has a curve on the cylinder: it keeps its parameter, as a B-spline.
    assert done.curves[2].degree == 1
    for rational in (False, True):
        part = sheet(rational)
        lattice = _affine(part, matrix, np.zeros(3))
        done = deform_part(part, lattice)
        assert set(done.face_kinds) | set(done.edge_kinds) == {EXACT}
        faces, edges = distances(part, lattice, done)
        assert max(faces.max(), edges.max()) <= 1e-13 * part.size
        assert np.array_equal(done.surfaces[0].knots[0], part.surfaces[0].knots[0])


def test_planes_and_lines_are_composed():
    part = cylinder()
    lattice = lattice_for(part)
    done = deform_part(part, lattice)
    assert done.face_kinds.tolist() == [FITTED, EXACT, EXACT]
    assert done.edge_kinds.tolist() == [FITTED, FITTED, EXACT]
    assert done.surfaces[1].degrees == (3, 3)
    faces, edges = distances(part, lattice, done)
    assert faces[1:].max() <= 1e-13 * part.size
    assert edges[2] <= 1e-13 * part.size


def test_tolerances_grow_by_bounds_and_never_fall():
    part = cylinder()
    done = deform_part(part, lattice_for(part))
    beside = done.face_bounds[0]
    assert (done.edge_tolerance >= part.edge_tolerance + done.edge_bounds + beside).all()
    assert (done.edge_tolerance <= 3e-7 + done.edge_bounds + beside).all()
    assert done.vertex_tolerance[0] >= done.edge_tolerance[[0, 2]].max()
    assert done.vertex_tolerance[1] >= done.edge_tolerance[[1, 2]].max()
    report = done.report["largest_tolerance"]
    assert report["read"] == 1e-7
    assert report["written"] == done.vertex_tolerance.max()


def test_fewer_control_points_at_a_larger_tolerance():
    part = ball()
    lattice = lattice_for(part)
    counts = [deform_part(part, lattice, share * part.size).control_points
              for share in (1e-3, 1e-4, 1e-5)]  # fmt: skip
    assert counts[0] < counts[1] < counts[2] < 4000


def test_finer_fits_are_quintic_and_degrees_are_capped():
    part = cylinder()
    lattice = lattice_for(part)
    for share, most, wanted in ((1e-5, None, 3), (1e-6, None, 5), (1e-6, 4, 4)):
        done = deform_part(part, lattice, share * part.size, most)
        assert done.surfaces[0].degrees == (wanted, wanted)
        faces, edges = distances(part, lattice, done)
        assert (faces <= done.face_bounds + 1e-12 * part.size).all()
        assert (edges <= done.edge_bounds + 1e-12 * part.size).all()


def test_exact_images_above_the_largest_degree_are_fitted():
    part = cylinder()
    tilted = Line(np.array([0.0, -1, 1]), np.array([0.6, 0.48, 0.64]))
    part = replace(part, curves=(tilted, *part.curves[1:]), edge_range=np.tile([0.0, 2], (3, 1)))
    lattice = lattice_for(part)
    assert deform_part(part, lattice).curves[0].degree == 9
    done = deform_part(part, lattice, max_degree=6)
    assert done.curves[0].degree == 3
    assert done.edge_kinds[0] == FITTED


def test_a_crease_across_a_face_is_refused():
    part = ball()
    with pytest.raises(CheckError, match=r"face 1 cannot be fitted within .* control points"):
        deform_part(part, lattice_for(part, degree=[1, 1, 1], points=[4, 4, 4]), 1e-7 * part.size)


def test_a_tolerance_below_rounding_is_refused():
    part = sheet()
    with pytest.raises(LatticeError, match="less than coordinates"):
        deform_part(part, lattice_for(part), 1e-13 * part.size)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.inf, np.nan])
def test_a_tolerance_must_be_a_length(tolerance):
    part = sheet()
    with pytest.raises(LatticeError, match="positive length"):
        deform_part(part, lattice_for(part), tolerance)
