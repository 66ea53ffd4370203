"""Rational lattices: weights by edits, at rest, part of the way, locked, saved."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice, save_lattice
from support.lattice_models import FAR, HIGH, LOW, SMALLER, box_triangles, settled

COUNTS = (6, 6, 6)
RANDOM = np.random.default_rng(4).uniform(0.2, 5, size=COUNTS)
TWIST = {"twist": {"axis": "w", "angle": 40}}


def nurbs(*edits, **keys):
    return settled(volume="nurbs", edits=list(edits), **keys)


def points_inside(seed=0, count=50):
    return np.random.default_rng(seed).uniform(LOW, HIGH, size=(count, 3))


def test_without_weights_a_nurbs_volume_is_the_bspline():
    lattice = nurbs(TWIST)
    assert lattice.volume.net.shape == (*COUNTS, 3)
    assert np.array_equal(lattice.volume.net, settled(edits=[TWIST]).volume.net)


@pytest.mark.parametrize("value", [3.0, 0.1])
def test_equal_weights_cancel_to_three_components(value):
    lattice = nurbs(TWIST, {"weight": {"at": [":", ":", ":"], "value": value}})
    assert np.array_equal(lattice.volume.net, settled(edits=[TWIST]).volume.net)
    assert np.all(lattice.weights == value)


def test_weights_are_homogeneous_and_deform_control_points_at_rest():
    lattice = nurbs({"weight": {"at": [2, 2, 2], "value": 4}})
    net = lattice.volume.net
    assert net.shape == (*COUNTS, 4)
    assert np.count_nonzero(net[..., 3] != 1) == 1
    assert net[2, 2, 2, 3] == 4
    assert np.array_equal(lattice.points, lattice.volume.rest_points)
    places = points_inside()
    moved = lattice.volume.evaluate(places) - places
    towards = lattice.points[2, 2, 2] - places
    drawn = np.linalg.norm(moved, axis=1) > 1e-9
    assert drawn.any()
    cosine = (moved * towards).sum(axis=1)[drawn] / np.linalg.norm(moved[drawn], axis=1)
    np.testing.assert_allclose(cosine, np.linalg.norm(towards[drawn], axis=1), rtol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_images_are_weighted_means_of_control_points(seed):
    lattice = nurbs(TWIST, {"weights": RANDOM.tolist()})
    volume, places = lattice.volume, points_inside(seed, 5)
    basis = volume.basis_matrix(places).toarray()
    weights, points = lattice.weights.ravel(), lattice.points.reshape(-1, 3)
    expected = (basis * weights) @ points / (basis @ weights)[:, None]
    np.testing.assert_allclose(volume.evaluate(places), expected, atol=1e-13)


def test_later_edits_keep_weights_and_move_control_points():
    lattice = nurbs({"weights": RANDOM.tolist()}, TWIST)
    assert np.array_equal(lattice.weights, RANDOM)
    assert np.array_equal(lattice.points, settled(edits=[TWIST]).points)
    later = nurbs({"weights": RANDOM.tolist()}, {"weight": {"at": [0, 0, 0], "value": 9}})
    assert later.weights[0, 0, 0] == 9
    assert np.array_equal(later.weights[1:], RANDOM[1:])


def test_scaled_runs_points_and_weights_on_straight_lines():
    lattice = nurbs(TWIST, {"weights": RANDOM.tolist()})
    part = lattice.scaled(0.25)
    np.testing.assert_allclose(part.weights, 0.75 + 0.25 * RANDOM, rtol=1e-15)
    rest = lattice.volume.rest_points
    np.testing.assert_allclose(part.points, 0.75 * rest + 0.25 * lattice.points, atol=1e-14)
    at_rest = lattice.scaled(0)
    assert np.array_equal(at_rest.volume.net, rest)
    assert lattice.scaled(1) is lattice
    with pytest.raises(LatticeError, match="zero or negative"):
        lattice.scaled(-1)
    with pytest.raises(LatticeError, match="zero or negative"):
        lattice.scaled(2)


def test_locked_weights_are_refused_by_name():
    for edit in ({"weight": {"at": [0, 3, 1], "value": 2}}, {"weights": RANDOM.tolist()}):
        with pytest.raises(LatticeError, match=r"changes the weight of .*locked.*w_min") as caught:
            nurbs(edit, **SMALLER)
        assert caught.value.key.startswith(f"edits[0].{next(iter(edit))}")
    free = np.ones(COUNTS)
    free[:, :, 2:] = 3
    lattice = nurbs({"weights": free.tolist()}, **SMALLER)
    side = np.array([[1.1, 0.7, 3.0], [2.0, 1.5, 3.0]])
    np.testing.assert_allclose(lattice.volume.evaluate(side), side, atol=1e-14)
    jacobian = lattice.volume.jacobian(side)
    np.testing.assert_allclose(jacobian, np.broadcast_to(np.eye(3), (2, 3, 3)), atol=1e-13)


def test_with_net_takes_homogeneous_control_points():
    lattice = nurbs(TWIST, {"weights": RANDOM.tolist()})
    same = lattice.with_net(lattice.volume.net)
    np.testing.assert_allclose(same.points, lattice.points, rtol=1e-15)
    assert np.array_equal(same.weights, lattice.weights)
    assert np.all(lattice.with_net(lattice.points).weights == 1)
    bad = lattice.volume.net.copy()
    bad[1, 1, 1, 3] = 0
    with pytest.raises(LatticeError, match="not greater than 0"):
        lattice.with_net(bad)
    with pytest.raises(LatticeError, match="a control net here is"):
        settled().with_net(lattice.volume.net)


@pytest.mark.parametrize("counts", [COUNTS, (11, 11, 11)])
@pytest.mark.parametrize("shift", [0, FAR])
def test_saved_lattice_reads_back_to_the_last_bit(counts, shift, tmp_path):
    weights = np.random.default_rng(4).uniform(0.2, 5, size=counts)
    low, high = LOW + shift + 0.1, HIGH + shift + 1 / 3
    lattice = nurbs(TWIST, {"weights": weights.tolist()}, points=list(counts), low=low, high=high)
    files = save_lattice(lattice, tmp_path / "solved.yaml")
    names = [file.name for file in files]
    assert names[-1] == "solved.yaml"
    assert len(files) == (1 if counts == COUNTS else 3)
    assert sorted(names) == sorted(path.name for path in tmp_path.iterdir())
    again = load_lattice(tmp_path / "solved.yaml").settle(
        bounds=np.array([low, high]), triangles=box_triangles(low, high), delta=1e-9
    )
    assert np.array_equal(again.volume.net, lattice.volume.net)
    assert again.volume.same_basis(lattice.volume)


TEXT = "version: 1\nvolume: nurbs\ndegree: [1, 1, 1]\npoints: [2, 3, 4]\nedits:\n  - weights: {}\n"
WEIGHTS = np.arange(1.0, 25).reshape(2, 3, 4) / 7


@pytest.mark.parametrize("header", ["", "weight\n", "Weight\n\n"])
def test_csv_has_w_fastest(tmp_path, header):
    (tmp_path / "w.csv").write_text(header + "\n".join(map(repr, WEIGHTS.ravel().tolist())))
    (tmp_path / "l.yaml").write_text(TEXT.format("w.csv"))
    assert np.array_equal(load_lattice(tmp_path / "l.yaml").definitions[0].nets[0], WEIGHTS)


def test_npy_and_lists(tmp_path):
    np.save(tmp_path / "w.npy", WEIGHTS)
    for given_as in ("w.npy", WEIGHTS.tolist()):
        (tmp_path / "l.yaml").write_text(TEXT.format(given_as))
        assert np.array_equal(load_lattice(tmp_path / "l.yaml").definitions[0].nets[0], WEIGHTS)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (WEIGHTS[..., None], "needed are"),
        (WEIGHTS - 1, r"the weight -0.857143 at control point \[0, 0, 0\]"),
        (np.where(WEIGHTS == 1, np.inf, WEIGHTS), "not finite"),
        (np.where(WEIGHTS == 1, 0, WEIGHTS), r"the weight 0 at control point \[0, 1, 2\]"),
    ],
)
def test_wrong_weight_files_are_refused(tmp_path, array, words):
    np.save(tmp_path / "w.npy", array)
    (tmp_path / "l.yaml").write_text(TEXT.format("w.npy"))
    with pytest.raises(LatticeError, match=words) as caught:
        load_lattice(tmp_path / "l.yaml")
    assert (caught.value.line, caught.value.key) == (6, "edits[0].weights")


def test_wrong_weight_rows_are_refused(tmp_path):
    (tmp_path / "l.yaml").write_text(TEXT.format("w.csv"))
    for text, words in (("1\n2,3\n", "row 2 is not a number"), ("1\n2\n", "2 rows")):
        (tmp_path / "w.csv").write_text(text)
        with pytest.raises(LatticeError, match=words):
            load_lattice(tmp_path / "l.yaml")


def test_weights_times_coordinates_too_large_are_refused():
    huge = {"weight": {"at": [5, 5, 5], "value": 1e308}}
    with pytest.raises(LatticeError, match="too large"):
        nurbs(huge)


def images(lattice, sources):
    return lattice.volume.evaluate(np.asarray(sources, dtype=float))


@pytest.mark.parametrize("edits", [[], [TWIST, {"weights": RANDOM.tolist()}]])
def test_weights_can_be_dragged(edits):
    lattice = nurbs(*edits)
    sources = np.array([[1, 1, 3], [2, 0.5, 4.5]])
    targets = images(lattice, sources) + [[0.1, 0, 0.2], [-0.1, 0.1, 0.1]]
    moved = lattice.drag(sources, targets, vary="weights")
    np.testing.assert_allclose(images(moved, sources), targets, rtol=0, atol=1e-12 * 7)
    assert np.array_equal(moved.points, lattice.points)
    assert np.all(moved.weights >= 0.01 * lattice.weights)
    reaching = lattice.volume.basis_matrix(sources).toarray().any(axis=0).reshape(COUNTS)
    assert np.array_equal(moved.weights[~reaching], lattice.weights[~reaching])


def test_dragging_weights_holds_and_pins():
    lattice = nurbs(points=[6, 6, 9])
    box = {"inside": {"min": [0, 0, 0], "max": [3, 2, 1]}}
    pin = [[0, ":", ":"]]
    moved = lattice.drag(
        [(1.5, 1, 3)], [(1.5, 1, 3.2)], vary="weights", hold=[box, {"point": [1, 1, 2]}], pin=pin
    )
    np.testing.assert_allclose(
        images(moved, [(1.5, 1, 3), (1, 1, 2)]), [(1.5, 1, 3.2), (1, 1, 2)], atol=1e-12
    )
    assert np.all(moved.weights[0] == 1)
    held = np.random.default_rng(0).uniform([0, 0, 0], [3, 2, 1], size=(50, 3))
    np.testing.assert_allclose(images(moved, held), held, atol=1e-13)


def test_weights_cannot_reach_beyond_the_hull():
    with pytest.raises(LatticeError, match=r"sources\[0\] by 5 \(its target is outside the hull"):
        nurbs().drag([(1, 1, 3)], [(1, 1, 8)], vary="weights")
    with pytest.raises(LatticeError, match="no positive weights meet all targets"):
        nurbs().drag([(1, 1, 3)] * 2, [(1, 1, 3.1), (1, 1, 3.2)], vary="weights")
    with pytest.raises(LatticeError, match="outside the lattice box"):
        nurbs().drag([(1, 1, 9)], [(1, 1, 8)], vary="weights")
    with pytest.raises(LatticeError, match="least squares needs"):
        nurbs().drag([(1, 1, 3)], [(1, 1, 4)], vary="weights", on_conflict="least_squares")
    hold = [{"inside": {"min": [0, 0, 0], "max": [1, 1, 1]}, "rigid": True}]
    with pytest.raises(LatticeError, match="rigid body"):
        nurbs().drag([(1, 1, 3)], [(1, 1, 4)], vary="weights", hold=hold)
