"""Peaks whose weights change: crimps are sharper the greater the sharpness, hammers keep shapes."""

import numpy as np
import pytest
import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from support.jobs import ellipsoid

WEIGHTED = {
    "nurbs": "volume: nurbs\npoints: [7, 7, 5]\n",
    "quadratic": "volume: nurbs\ndegree: [2, 2, 2]\npoints: [8, 7, 4]\n",
    "tspline": "volume: tspline\noctree: {depth: 3}\n",
    "light": "volume: tspline\noctree: {depth: 3, weights: [10, 1]}\n",
    "deep inside": "volume: tspline\noctree: {depth: 2, also: "
    "[{min: [0.3, 0.3, 0.8], max: [0.7, 0.7, 1], depth: 4}]}\n",
}
MIDDLE = (0.5, 0.5, 1.0)
SHARPNESS = st.floats(0.01, 100)
only = settings(derandomize=True, deadline=None, max_examples=8, phases=[Phase.generate])


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "cube.obj"
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).export(path)
    return read_mesh(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("lattices")


def edited(folder, mesh, kind, edits):
    path = folder / "l.yaml"
    listed = "".join(f"  - {edit}\n" for edit in edits)
    path.write_text(f"version: 1\n{WEIGHTED[kind]}edits:\n{listed}")
    return read_lattice(path, mesh)


def crimped(folder, mesh, kind, point, sharpness, raised=None):
    raised = raised or f"hammer: {{point: {list(point)}, height: 0.3}}"
    edits = [raised, f"crimp: {{point: {list(point)}, sharpness: {sharpness!r}}}"]
    return edited(folder, mesh, kind, edits)


def way(point, angle, reach=0.5):
    """Places (40, 3) on the top of the cube, from a point along a direction."""
    step = np.linspace(0, reach, 41)[1:, None] * [np.cos(angle), np.sin(angle), 0]
    places = np.array(point) + step
    return places[np.all((places >= 0) & (places <= 1), axis=1)]


def heights(lattice, places):
    return (lattice.volume.evaluate(np.atleast_2d(places)) - places)[:, 2]


def hats(degree, count, at):
    """All B-splines (m, count) of a clamped uniform knot vector, by scipy."""
    inner = np.linspace(0, 1, count - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    return BSpline.design_matrix(at, knots, degree).toarray()


@only
@given(st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.floats(0, 6.2), SHARPNESS)
def test_the_profile_is_divided_by_the_mean_factor(folder, cube, u, v, angle, sharpness):
    """On a plane the peak is multiplied by W(point) / W(x), which is monotone in the sharpness."""
    point = (u, v, 1.0)
    places = np.concatenate([[point], way(point, angle)])
    before, after = (
        heights(crimped(folder, cube, "nurbs", point, s), places) for s in (1, sharpness)
    )
    basis = np.einsum("mi,mj->mij", hats(3, 7, places[:, 0]), hats(3, 7, places[:, 1]))
    share = (basis * basis[0] / basis[0].max()).sum(axis=(1, 2))
    mean = 1 - (1 - 1 / sharpness) * share
    assert abs(after[0] - 0.3) < 1e-12
    assert np.abs(after - before * mean[0] / mean).max() < 1e-11


@pytest.mark.parametrize("kind", WEIGHTED)
@only
@given(st.floats(0, 6.2), SHARPNESS, SHARPNESS)
def test_more_sharpness_is_sharper_everywhere(folder, cube, kind, angle, one, other):
    fuller, sharper = sorted((one, other))
    places = way(MIDDLE, angle)
    high, low = (
        heights(crimped(folder, cube, kind, MIDDLE, each), places) for each in (fuller, sharper)
    )
    assert np.all(low <= high + 1e-12)
    assert np.all(low > -1e-12)
    lattice = crimped(folder, cube, kind, MIDDLE, sharper)
    assert abs(heights(lattice, MIDDLE)[0] - 0.3) < 1e-12
    assert np.isfinite(lattice.members[0].points).all()
    assert np.all(lattice.members[0].weights > 0)


@pytest.mark.parametrize("kind", WEIGHTED)
@pytest.mark.parametrize("raised", ["hammer", "move"])
def test_a_sharper_peak_is_narrower_in_space(folder, cube, kind, raised):
    """The points beside it stay: the shape of the result gets sharper, not only the heights."""
    edit = None
    if raised == "move":
        edit = "move: {at: {near: [0.5, 0.5, 1]}, by: [0, 0, 0.6]}"
    widths = []
    for sharpness in (0.2, 1, 4, 50):
        places = way(MIDDLE, 0.0)
        lattice = crimped(folder, cube, kind, MIDDLE, sharpness, edit)
        images = lattice.volume.evaluate(places)
        level = heights(lattice, MIDDLE)[0] / 2 + 1
        widths.append(np.interp(-level, -images[:, 2], images[:, 0]) - 0.5)
    assert np.all(np.diff(widths) < -0.0005)


def test_sharpness_one_changes_nothing(folder, cube):
    raised = f"hammer: {{point: {list(MIDDLE)}, height: 0.3}}"
    before = edited(folder, cube, "nurbs", [raised]).members[0]
    after = crimped(folder, cube, "nurbs", MIDDLE, 1).members[0]
    assert np.array_equal(before.points, after.points)
    assert np.array_equal(before.weights, after.weights)


@pytest.mark.parametrize("kind", ["nurbs", "tspline"])
def test_a_crimp_on_a_curved_surface_keeps_the_height(tmp_path, folder, kind):
    mesh = ellipsoid(tmp_path, 3)
    top = (0.0, 0.0, 5.0)
    raised = "move: {at: {near: [0.5, 0.2, 5]}, by: [0.2, -0.1, 2]}"
    first = edited(folder, mesh, kind, [raised]).volume.evaluate(np.array([top]))[0] - top
    along = first / np.linalg.norm(first)
    for sharpness in (0.25, 5.0):
        lattice = crimped(folder, mesh, kind, top, sharpness, raised)
        image = lattice.volume.evaluate(np.array([top]))[0] - top
        assert abs(image @ along - np.linalg.norm(first)) < 1e-12


# Largest change of the profile, as a share of the height, at heights 0.25 and 0.35 instead of 0.3.
# The top of the quadratic peak lies between two equal control points, which keeps it least.
KEPT = {"nurbs": 0.03, "quadratic": 0.2, "tspline": 0.035, "light": 0.035, "deep inside": 0.015}


@pytest.mark.parametrize("kind", WEIGHTED)
@pytest.mark.parametrize("height", [0.25, 0.35])
def test_a_hammer_by_weights_sets_the_height_and_keeps_the_profile(folder, cube, kind, height):
    raised = f"hammer: {{point: {list(MIDDLE)}, height: 0.3}}"
    again = f"hammer: {{point: {list(MIDDLE)}, height: {height}, by: weights}}"
    before = edited(folder, cube, kind, [raised])
    after = edited(folder, cube, kind, [raised, again])
    assert abs(heights(after, MIDDLE)[0] - height) < 1e-12
    assert np.array_equal(before.members[0].points, after.members[0].points)
    factors = np.unique(np.round(after.members[0].weights / before.members[0].weights, 9))
    assert len(factors) == 3
    assert factors.min() >= 0.01
    assert factors.max() <= 100
    places = np.concatenate([way(MIDDLE, angle) for angle in np.arange(8) * np.pi / 4])
    change = heights(after, places) / height - heights(before, places) / 0.3
    assert np.abs(change).max() < KEPT[kind]


def test_a_height_that_weights_do_not_reach_is_refused_with_the_one_they_do(folder, cube):
    raised = f"hammer: {{point: {list(MIDDLE)}, height: 0.3}}"
    again = f"hammer: {{point: {list(MIDDLE)}, height: %r, by: weights}}"
    with pytest.raises(LatticeError, match=r"from 0\.1\d+ to 0\.5\d+ high, not 0\.9") as caught:
        edited(folder, cube, "nurbs", [raised, again % 0.9])
    low, high = [float(w) for w in str(caught.value).split() if w.startswith("0.")][:2]
    # The highest control point bounds it, and it is nearly reached.
    top = edited(folder, cube, "nurbs", [raised]).members[0].points[..., 2].max() - 1
    assert 0.99 * top < high < top
    reached = edited(folder, cube, "nurbs", [raised, again % (0.999 * high)])
    assert abs(heights(reached, MIDDLE)[0] - 0.999 * high) < 1e-12
    with pytest.raises(LatticeError, match=r"high, not 0\.01"):
        edited(folder, cube, "nurbs", [raised, again % (0.1 * low)])


def test_a_hammer_by_weights_needs_a_peak_and_weights(folder, cube, tmp_path):
    again = f"hammer: {{point: {list(MIDDLE)}, height: 0.2, by: weights}}"
    with pytest.raises(LatticeError, match="there is no peak"):
        edited(folder, cube, "nurbs", [again])
    path = tmp_path / "b.yaml"
    path.write_text(f"version: 1\nedits:\n  - {again}\n")
    with pytest.raises(LatticeError, match="has no weights"):
        read_lattice(path, cube)
