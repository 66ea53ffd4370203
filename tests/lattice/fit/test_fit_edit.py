"""The edit `fit`: its keys, its report, and data that is poor or wrong."""

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from support.fits import displacements, fitted, grown, settle, wavy

KINDS = [
    {"points": [5, 5, 5]},
    {"volume": "nurbs", "points": [5, 5, 5]},
    {"volume": "hierarchical", "octree": {"depth": "auto"}},
]
EVERYWHERE = np.random.default_rng(0).random((300, 3))


@pytest.mark.parametrize("keys", KINDS)
def test_a_rigid_motion_is_one_everywhere(keys):
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    places = EVERYWHERE[:30]
    lattice, report = fitted(keys, places, places @ turn.T - places + [1, 2, 3])
    wanted = EVERYWHERE @ turn.T - EVERYWHERE + [1, 2, 3]
    np.testing.assert_allclose(displacements(lattice, EVERYWHERE), wanted, atol=1e-12)
    assert not lattice.warnings
    assert report["within_tolerance"] == 1


@pytest.mark.parametrize("keys", KINDS)
def test_one_point_shifts_all(keys):
    lattice, _ = fitted(keys, np.array([[0.3, 0.3, 0.3]]), np.array([[1.0, 2.0, 3.0]]))
    moved = displacements(lattice, EVERYWHERE)
    np.testing.assert_allclose(moved, np.tile([1, 2, 3], (300, 1)), atol=1e-12)
    assert "the only pair lies in one point" in lattice.warnings[0]


@pytest.mark.parametrize("keys", KINDS)
def test_points_in_a_plane_are_met_and_the_field_goes_on(keys):
    places = EVERYWHERE[:60].copy()
    places[:, 2] = 0.5
    moves = np.column_stack([0.1 * places[:, 0], 0.1 * places[:, 1] ** 2, 0 * places[:, 0]])
    lattice, report = fitted(keys, places, moves)
    assert report["largest"] < 1e-6
    above = places + [0, 0, 0.3]
    np.testing.assert_allclose(displacements(lattice, above), moves, atol=0.02)
    assert "all pairs lie in a plane" in lattice.warnings[-1]


@pytest.mark.parametrize("keys", KINDS)
def test_two_targets_for_one_point_meet_in_between(keys):
    places = np.concatenate([EVERYWHERE[:40], EVERYWHERE[:1]])
    moves = np.zeros((41, 3))
    moves[40, 2] = 0.2
    lattice, _ = fitted(keys, places, moves)
    between = displacements(lattice, places[:1])[0, 2]
    assert 0 < between <= 0.1 + 1e-9
    text = " ".join(lattice.warnings)
    assert "pairs 1 and 41 give one point two targets, 0.2 apart" in text


def test_fewer_points_than_control_points_are_met():
    places = EVERYWHERE[:20]
    lattice, report = fitted({"points": [6, 6, 6]}, places, wavy(places))
    assert report["control_points"] == 216
    assert np.abs(displacements(lattice, EVERYWHERE)).max() < 1


def test_pairs_outside_the_box_are_counted_and_left_out():
    places = np.concatenate([EVERYWHERE[:30], [[2.0, 2, 2], [0.5, 0.5, 1.5]]])
    moves = np.zeros((32, 3))
    moves[30:] = 5
    lattice, report = fitted({"points": [4, 4, 4]}, places, moves)
    assert report["outside"] == 2
    assert report["pairs"] == 30
    assert np.abs(displacements(lattice, EVERYWHERE)).max() < 1e-12
    assert "2 pairs lie outside the lattice box, such as pair 31" in lattice.warnings[0]
    with pytest.raises(LatticeError, match="no pair lies inside the lattice box"):
        fitted({"points": [4, 4, 4]}, places[30:], moves[30:])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(bad):
    rest = settle({"points": [4, 4, 4]})
    with pytest.raises(LatticeError, match="finite numbers"):
        rest.fit([[0, 0, bad]], [[0, 0, 0]])
    with pytest.raises(LatticeError, match="finite numbers greater than 0"):
        rest.fit([[0, 0, 0]], [[0, 0, 0]], weights=[bad])


@pytest.mark.parametrize(
    ("keys", "fit", "words"),
    [
        ({}, {"scale": 0}, "must not be 0"),
        ({}, {"tolerance": 0}, "greater than 0"),
        ({}, {"smooth": -1}, "at least 0"),
        ({}, {"hold": [{"inside": {"min": [0] * 3, "max": [1] * 3}, "rigid": True}]}, "rigid body"),
        ({}, {"hold": [{"inside": {"min": [1] * 3, "max": [0] * 3}}]}, "is below min"),
        ({}, {"pin": [[9, 0, 0]]}, "pin"),
        ({"volume": "tspline", "octree": {"depth": 1}}, {}, "tspline volume cannot be fitted"),
        ({"volume": "hierarchical", "octree": {"depth": 1}, "degree": [1, 2, 2]}, {}, "degree 2"),
    ],
)
def test_wrong_keys_are_refused(keys, fit, words):
    with pytest.raises(LatticeError, match=words):
        fitted(keys, EVERYWHERE, 0 * EVERYWHERE, **fit)


@pytest.mark.parametrize("keys", KINDS[:1] + [{"volume": "hierarchical", "octree": {"depth": 2}}])
def test_held_points_and_parts_stay(keys):
    inside = {"min": [0.7, 0.7, 0.7], "max": [1, 1, 1]}
    hold = [{"point": [0.5, 0.2, 0.5]}, {"point": [0.1, 0.1, 0.1]}, {"inside": inside}]
    shift = np.tile([0, 0, 0.1], (300, 1))
    lattice, _ = fitted(keys, EVERYWHERE, shift, hold=hold, robust=False)
    still = np.array([[0.5, 0.2, 0.5], [0.1, 0.1, 0.1], [0.7, 0.7, 0.7], [0.9, 0.8, 1]])
    assert np.abs(displacements(lattice, still)).max() < 1e-9
    assert displacements(lattice, np.array([[0.1, 0.9, 0.1]]))[0, 2] > 0.03


def test_pinned_control_points_stay():
    pin = [[":", ":", 0]]
    lattice, _ = fitted({"points": [5, 5, 5]}, EVERYWHERE, wavy(EVERYWHERE), pin=pin)
    rest = lattice.maps[0].rest_points
    moved = np.any(lattice.points != rest, axis=-1)
    assert not moved[:, :, 0].any()
    assert moved[:, :, 2:].any()


def test_everything_pinned_is_refused():
    with pytest.raises(LatticeError, match="no control point is free"):
        fitted({"points": [4, 4, 4]}, EVERYWHERE, wavy(EVERYWHERE), pin=[[":", ":", ":"]])


@pytest.mark.parametrize("keys", KINDS)
def test_a_scale_compensates(keys):
    forth, _ = fitted(keys, EVERYWHERE, 0.1 * wavy(EVERYWHERE), tolerance=1e-3)
    back, _ = fitted(keys, EVERYWHERE, 0.1 * wavy(EVERYWHERE), tolerance=1e-3, scale=-1)
    there = displacements(forth, EVERYWHERE)
    np.testing.assert_allclose(displacements(back, EVERYWHERE), -there, atol=1e-9)


def test_weights_decide_between_targets():
    places = np.full((2, 3), 0.5)
    rest = settle({"points": [4, 4, 4]})
    found = rest.fit(places, [[0, 0, 0], [0, 0, 1.0]], by=True, weights=[1, 3])
    assert displacements(found, places)[0, 2] == pytest.approx(0.75)


def test_targets_are_met_as_displacements_are():
    rest = settle({"points": [5, 5, 5]})
    by = rest.fit(EVERYWHERE, wavy(EVERYWHERE), by=True)
    to = rest.fit(EVERYWHERE, EVERYWHERE + wavy(EVERYWHERE))
    np.testing.assert_allclose(to.points, by.points, atol=1e-9)
    # A target is where the image ends, whatever came before.
    again = by.fit(EVERYWHERE, EVERYWHERE + wavy(EVERYWHERE))
    assert again.fits[1].as_report()["rms"] <= by.fits[0].as_report()["rms"]


def test_a_turned_box_gives_the_same_field():
    turn = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    box = {"center": [0.5, 0.5, 0.5], "size": [1, 1, 1], "axes": turn}
    there, report = fitted({"points": [6, 6, 6], "box": box}, EVERYWHERE, wavy(EVERYWHERE))
    here, other = fitted({"points": [6, 6, 6]}, EVERYWHERE, wavy(EVERYWHERE))
    assert report["rms"] == pytest.approx(other["rms"], rel=1e-3)
    np.testing.assert_allclose(
        displacements(there, EVERYWHERE), displacements(here, EVERYWHERE), atol=1e-4
    )
    left = wavy(EVERYWHERE) - displacements(there, EVERYWHERE)
    np.testing.assert_allclose(there.fits[0].left, left, atol=1e-12)


def test_the_report_adds_up():
    places = np.random.default_rng(2).random((500, 3))
    lattice, report = grown(places, wavy(places), {"max_depth": 1}, tolerance=1e-3)
    left = np.linalg.norm(wavy(places) - displacements(lattice, places), axis=1)
    kept = left[~lattice.fits[0].outlier]
    assert report["rms"] == pytest.approx(np.sqrt(np.mean(kept**2)))
    assert report["largest"] == pytest.approx(kept.max())
    assert report["within_tolerance"] == np.mean(left <= 1e-3)
    np.testing.assert_allclose(places[report["largest_pair"] - 1], report["largest_at"])
    assert sum(report["levels"]) == report["control_points"]
