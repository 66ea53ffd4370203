"""Noise is not fitted, and outliers are named and left out."""

import numpy as np
import pytest

from support.fits import displacements, fitted, grown, wavy


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_noise_of_known_size_is_left(seed, noise):
    rng = np.random.default_rng(seed)
    places, others = rng.random((2500, 3)), 0.1 + 0.8 * rng.random((1000, 3))
    moves = wavy(places) + noise * rng.standard_normal(places.shape)
    lattice, report = fitted({"points": [8, 8, 8]}, places, moves)
    size = noise * np.sqrt(3)
    assert 0.8 * size < report["rms"] < 1.1 * size
    assert 0.9 * size < report["noise"] < 1.1 * size
    assert report["outliers"] == 0
    error = np.linalg.norm(displacements(lattice, others) - wavy(others), axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.6 * size


@pytest.mark.parametrize("seed", range(3))
def test_an_octree_stops_at_the_noise(seed):
    rng = np.random.default_rng(seed)
    places, noise = rng.random((3000, 3)), 3e-3
    moves = wavy(places) + noise * rng.standard_normal(places.shape)
    lattice, report = grown(places, moves)
    assert report["stopped"] == "noise"
    assert 0.8 * noise < report["rms"] / np.sqrt(3) < 1.1 * noise
    assert report["control_points"] < 1000
    assert "the rest is noise" in " ".join(lattice.warnings)


@pytest.mark.parametrize("seed", range(3))
def test_outliers_are_named_and_do_not_count(seed):
    rng = np.random.default_rng(seed)
    places, others = rng.random((3000, 3)), 0.1 + 0.8 * rng.random((1000, 3))
    moves = wavy(places) + 1e-3 * rng.standard_normal(places.shape)
    wrong = rng.choice(3000, 60, replace=False)
    way = rng.standard_normal((60, 3))
    moves[wrong] += 0.3 * way / np.linalg.norm(way, axis=1)[:, None]
    lattice, report = fitted({"points": [7, 7, 7]}, places, moves)
    found = np.flatnonzero(lattice.fits[0].outlier)
    assert set(found) <= set(wrong)
    # In a corner of the box, where few pairs are, the functions may follow one.
    assert len(found) >= 59
    named = {entry["pair"] for entry in report["outliers_listed"]}
    assert named == set(found + 1)
    assert all(
        entry["distance"] == pytest.approx(0.3, abs=0.02) for entry in report["outliers_listed"]
    )
    assert report["rms"] < 3e-3
    error = np.linalg.norm(displacements(lattice, others) - wavy(others), axis=1)
    assert error.max() < 1e-2
    assert f"{len(found)} pairs disagree with those around" in " ".join(lattice.warnings)
    _, plain = fitted({"points": [7, 7, 7]}, places, moves, robust=False)
    assert plain["outliers"] == 0
    assert plain["rms"] > 0.02


@pytest.mark.parametrize("seed", range(3))
def test_clean_data_has_no_outliers(seed):
    places = np.random.default_rng(seed).random((2000, 3))
    for keys in ({"points": [5, 5, 5]}, {"points": [8, 8, 8]}):
        assert fitted(keys, places, wavy(places))[1]["outliers"] == 0


def test_many_control_points_start_from_few():
    rng = np.random.default_rng(3)
    places, noise = rng.random((9000, 3)), 3e-3
    moves = wavy(places) + noise * rng.standard_normal(places.shape)
    wrong = rng.choice(9000, 50, replace=False)
    moves[wrong] += 0.3
    _, report = fitted({"points": [15, 15, 15]}, places, moves)
    assert report["control_points"] == 3375
    assert report["noise"] == pytest.approx(noise * np.sqrt(3), rel=0.05)
    assert 48 <= report["outliers"] <= 50
    _, exact = fitted({"points": [15, 15, 15]}, places, wavy(places))
    assert exact["largest"] < 1e-4
