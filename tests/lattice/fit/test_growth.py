"""Cells that a fit divides: where the field needs it, within the limits, always the same."""

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from ffdcli.lattice import parse_lattice, solved_text
from ffdcli.lattice.file.source import Source, read_yaml
from support.fits import CUBE, dent, displacements, fitted, grown, settle, wavy
from support.lattice_models import box_triangles


@pytest.fixture(scope="module")
def places():
    return np.random.default_rng(3).random((6000, 3))


@pytest.fixture(scope="module")
def dented(places):
    return grown(places, dent(places), tolerance=1e-3)


def test_smooth_fields_are_reached(places):
    others = 0.05 + 0.9 * np.random.default_rng(4).random((1000, 3))
    lattice, report = grown(places, wavy(places), tolerance=5e-4)
    assert report["stopped"] == "tolerance"
    assert report["within_tolerance"] == 1
    assert report["largest"] <= 5e-4
    error = np.linalg.norm(displacements(lattice, others) - wavy(others), axis=1)
    assert error.max() < 5e-4


def test_a_dent_divides_cells_near_it_only(dented):
    lattice, report = dented
    assert report["stopped"] == "tolerance"
    assert report["within_tolerance"] == 1
    tree = lattice.member.cells.tree
    middle = (tree.low + tree.high) / 2 / tree.counts
    apart = np.linalg.norm(middle - [0.3, 0.4, 0.5], axis=1)
    finest = tree.levels == tree.depth
    assert tree.depth >= 3
    assert apart[finest].max() < 0.5
    assert finest.sum() < 0.1 * 8**tree.depth
    even = (2**tree.depth + 3) ** 3
    assert report["control_points"] < even / 2


def test_the_same_file_and_model_give_the_same_lattice(places, dented):
    lattice, _ = dented
    again, _ = grown(places, dent(places), tolerance=1e-3)
    assert np.array_equal(again.points, lattice.points)


def test_a_solved_file_keeps_the_cells(dented, tmp_path):
    lattice, _ = dented
    (tmp_path / "solved.yaml").write_text(solved_text(lattice))
    solved = parse_lattice(*read_yaml(tmp_path / "solved.yaml")).settle(
        bounds=CUBE, triangles=box_triangles(*CUBE), delta=1e-9
    )
    assert np.array_equal(solved.points, lattice.points)
    assert solved.maps[0].same_basis(lattice.maps[0])


def test_limits_are_kept(places):
    _, report = grown(places, dent(places), {"max_depth": 2}, tolerance=1e-4)
    assert report["stopped"] == "max_depth"
    assert len(report["levels"]) == 3
    lattice, report = grown(places, dent(places), {"max_points": 700}, tolerance=1e-4)
    assert report["stopped"] == "max_points"
    assert 300 < lattice.points.shape[0] <= 700
    assert "as `max_points` allows" in " ".join(lattice.warnings)


def test_parts_of_also_are_divided_from_the_start():
    rng = np.random.default_rng(5)
    places = rng.random((300, 3))
    part = {"min": [0, 0, 0], "max": [0.2, 0.2, 0.2], "depth": 3}
    lattice, _ = grown(places, 0 * places, {"also": [part]})
    tree = lattice.member.cells.tree
    assert tree.levels[tree.locate(np.zeros((1, 3), dtype=np.int64))] == 3


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"octree": {"depth": "auto"}, "edits": []}, "needs a `fit` as the first"),
        ({"octree": {"depth": 2, "max_depth": 3}}, "limits an octree that a fit divides"),
        ({"octree": {"depth": "auto", "balance": False}}, "is balanced"),
        ({"octree": {"depth": "soon"}}, "must be auto"),
        ({"octree": {"depth": "auto"}, "volume": "tspline"}, "a fit divides no tspline volume"),
        ({"octree": {"depth": "auto"}, "degree": [1, 1, 1]}, "degree 2"),
    ],
)
def test_what_cannot_be_is_refused(keys, words):
    fit = {"fit": {"pairs": [{"from": [0, 0, 0], "by": [0, 0, 0]}]}}
    with pytest.raises(LatticeError, match=words):
        parse_lattice({"version": 1, "volume": "hierarchical", "edits": [fit], **keys}, Source())


def test_later_edits_follow_the_fit(places):
    lattice, _ = fitted({"points": [4, 4, 4]}, places[:50], 0 * places[:50])
    assert np.abs(displacements(lattice, places)).max() < 1e-15
    fit = {"fit": {"pairs": [{"from": [0.5, 0.5, 0.5], "by": [0.1, 0, 0]}]}}
    drag = {"drag": {"pairs": [{"from": [0.5, 0.5, 0.5], "by": [0, 0.2, 0]}]}}
    keys = {"volume": "hierarchical", "octree": {"depth": "auto"}, "edits": [fit, drag]}
    both = settle(keys)
    moved = displacements(both, np.full((1, 3), 0.5))[0]
    np.testing.assert_allclose(moved, [0.1, 0.2, 0], atol=1e-12)
