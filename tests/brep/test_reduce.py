"""Reduced records: shared edges, tolerances, bounds, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.brep.evaluate.face_points import edge_points
from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.reduce import digits_within, reduce_brep
from ffdcli.brep.reduce_options import require_reducible
from ffdcli.errors import CheckError, FfdError
from ffdcli.verify import check_brep
from support.brep_models import bumpy, cube, plate_with_hole, split_cube
from support.verify_models import facets, sphere


def soft(points):
    """A gentle map of degree 4 in each coordinate."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([x + 0.2 * y**2 + 0.01 * z**4, y + 0.1 * x**3, z + 0.02 * x * y**4], axis=-1)


def hardly(points):
    """Hardly bent at all."""
    return points + 1e-6 * (bumpy(points) - points)


def poles(batches):
    return sum(batch.poles[..., 0].size for batch in batches)


def points_off(exact, reduced):
    """Largest distance of the same points of surfaces, and of curves."""
    both = [model_of_brep(brep) for brep in (exact, reduced)]
    edge = edge_points(both[0])
    curves = [model.on_edges(edge.edge, edge.at)[0] for model in both]
    rng = np.random.default_rng(0)
    face = np.repeat(np.arange(exact.face_count), 200)
    low, high = both[0].domain[face, 0], both[0].domain[face, 1]
    uv = low + rng.random(low.shape) * (high - low)
    faces = [model.on_faces(face, uv)[0] for model in both]
    return [np.linalg.norm(a - b, axis=1).max() for a, b in (faces, curves)]


@pytest.mark.parametrize("max_degree", [None, 3])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-3])
@pytest.mark.parametrize("make", [cube, plate_with_hole, split_cube])
def test_reduced_records_are_sound_and_within_their_bound(make, tolerance, max_degree):
    exact = make(soft, degree=6) if make is not split_cube else split_cube(hardly)
    reduced, bound = reduce_brep(exact, tolerance, max_degree)
    assert 0 < bound <= tolerance
    assert max(points_off(exact, reduced)) <= bound
    report = check_brep(reduced)
    assert report.faults == ()
    assert (report.edge_gaps <= bound).all()
    verdict = kernel_check(build_shape(reduced))
    assert verdict.valid, verdict.faults
    assert verdict.closed
    degrees = [degree for batch in reduced.surfaces for degree in batch.degrees]
    degrees += [batch.degree for batch in reduced.curves]
    if max_degree is None:
        assert poles(reduced.surfaces) < poles(exact.surfaces)
        assert poles(reduced.curves) < poles(exact.curves)
    else:
        assert max(degrees) <= max_degree


def test_edges_are_reduced_once_and_tolerances_follow_faces_and_edges():
    exact = cube(soft, degree=6, tolerance=2e-7)
    reduced, bound = reduce_brep(exact, 1e-3)
    edges = np.sort(np.concatenate([batch.edges for batch in reduced.curves]))
    assert np.array_equal(edges, np.arange(12))
    surfaces = np.sort(np.concatenate([batch.surfaces for batch in reduced.surfaces]))
    assert np.array_equal(surfaces, np.arange(6))
    # What the edges had before, more than the kernel needs, stays beside what is added.
    added = reduced.edge_tolerance - 2e-7
    assert added.max() == pytest.approx(bound, rel=1e-6)
    for vertex in range(8):
        around = (exact.edges == vertex).any(axis=1)
        assert reduced.vertex_tolerance[vertex] == reduced.edge_tolerance[around].max()
    assert np.array_equal(reduced.points, exact.points)
    assert np.array_equal(reduced.pcurves, exact.pcurves)


def test_nothing_changes_where_nothing_can():
    """Degree 1 is as low as can be, and planes stay planes: bound 0, every bit kept."""
    exact = cube()
    reduced, bound = reduce_brep(exact, 0.01)
    assert bound == 0
    assert np.array_equal(reduced.curves[0].poles, exact.curves[0].poles)
    assert np.array_equal(reduced.edge_tolerance, exact.edge_tolerance)


def test_narrow_faces_keep_their_width():
    """A tolerance far larger than a face's width does not make it cross itself."""
    exact = facets(*sphere(2), soft, 4)
    squeeze = exact.points * [1, 1, 1e-3]
    thin = replace(exact, points=squeeze)
    thin = replace(
        thin,
        curves=tuple(replace(b, poles=b.poles * [1, 1, 1e-3]) for b in exact.curves),
        surfaces=tuple(replace(b, poles=b.poles * [1, 1, 1e-3]) for b in exact.surfaces),
    )
    reduced, bound = reduce_brep(thin, 0.5)
    length = np.linalg.norm(np.diff(squeeze[exact.edges], axis=1)[:, 0], axis=1)
    assert (reduced.edge_tolerance < 0.11 * length).all()
    assert bound < 0.5
    assert check_brep(reduced).faults == ()


def test_a_tolerance_out_of_reach_names_one_that_is_not():
    exact = cube(soft, degree=6)
    with pytest.raises(CheckError, match="degree 3 does not come within 1e-13") as caught:
        reduce_brep(exact, 1e-13, 3)
    would_do = float(caught.value.hint.split()[3])
    _, bound = reduce_brep(exact, would_do, 3)
    assert 1e-13 < bound <= would_do


@pytest.mark.parametrize(
    ("tolerance", "degree"), [(0.0, None), (float("nan"), None), (-1.0, 3), (1e-3, 2), (None, 3)]
)
def test_what_makes_no_sense_is_refused(tolerance, degree):
    with pytest.raises(FfdError):
        require_reducible(tolerance, degree)


def test_short_numbers_only_where_they_do_not_show():
    exact = cube(soft, degree=6)
    assert digits_within(exact, 1e-4) == 13
    assert digits_within(exact, 1e-9) == 17
    far = replace(exact, points=exact.points + 1e6)
    assert digits_within(far, 1e-4) == 17
