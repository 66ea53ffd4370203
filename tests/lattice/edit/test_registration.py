"""Fits onto scans of a body deformed by a formula: they find the formula, unknown to them."""

import numpy as np
import pytest
import trimesh

from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import parse_lattice
from ffdcli.mesh import read_mesh
from ffdcli.models import settle_lattice
from support.scans import (
    FACES,
    IN_SPACE,
    NOISE,
    REST,
    SCANNED,
    body,
    deform,
    faces_of,
    write_mesh,
    write_points,
)

NET = "volume: bspline\npoints: [6, 6, 6]"
GROWN = "volume: hierarchical\noctree: {depth: auto}"
END, HOLE = REST[:, 0] > 0.6, np.linalg.norm(REST - [0, 0, 0.7], axis=1) < 0.6


@pytest.fixture
def model(tmp_path):
    return read_mesh(write_mesh(tmp_path / "model.obj", *body(3)))


def fitted(model, folder, scan, more="", volume=NET):
    text = f"version: 1\n{volume}\nedits:\n  - fit: {{target: {scan}, tolerance: {NOISE}{more}}}\n"
    return settle_lattice(parse_lattice(*parse_yaml(text, "l.yaml", folder)), model)


def errors(lattice, points):
    return np.linalg.norm(lattice.maps[0].evaluate(points) - deform(points), axis=1)


def require_found(lattice, points):
    """The map is the formula within twice the noise; what the figures say is so."""
    found = errors(lattice, points)
    assert np.sqrt(np.mean(found**2)) < IN_SPACE
    assert found.max() < 2 * IN_SPACE
    report = lattice.fits[0].as_report()["scan"]
    # Noise across the surface is what is left.
    assert report["scan_to_model"]["rms"] == pytest.approx(NOISE, rel=0.1)
    return report


@pytest.mark.parametrize("volume", [NET, GROWN], ids=["net", "octree"])
def test_a_noisy_scan_of_another_mesh_gives_the_map(model, tmp_path, volume):
    write_mesh(tmp_path / "scan.ply", SCANNED, FACES)
    report = require_found(fitted(model, tmp_path, "scan.ply", volume=volume), model.vertices)
    assert report["coverage"] == 1
    assert report["used"] > 0.99 * report["points"]
    assert report["model_to_scan"]["rms"] < 2 * NOISE


@pytest.mark.parametrize("missing", [END, HOLE], ids=["an end", "a hole"])
def test_a_scan_of_a_part_gives_the_map_there(model, tmp_path, missing):
    write_mesh(tmp_path / "scan.stl", SCANNED, faces_of(~missing))
    lattice = fitted(model, tmp_path, "scan.stl")
    near = np.linalg.norm(model.vertices[:, None] - REST[None, missing], axis=2).min(axis=1) < 0.15
    report = require_found(lattice, model.vertices[~near])
    area = np.mean(near)
    assert 1 - report["coverage"] == pytest.approx(area, abs=0.12)
    # Elsewhere the map stays of the size of what was scanned.
    assert errors(lattice, model.vertices).max() < 0.2
    assert any("of the model: elsewhere" in text for text in lattice.warnings)


def test_points_without_triangles_and_normals_give_the_map(model, tmp_path):
    write_points(tmp_path / "scan.xyz", SCANNED)
    require_found(fitted(model, tmp_path, "scan.xyz"), model.vertices)


def test_stray_points_and_another_body_do_not_count(model, tmp_path):
    random = np.random.default_rng(2)
    stray = random.uniform(-1, 1, (300, 3)) * [2.2, 1.3, 1.1]
    ball = random.normal(size=(200, 3))
    ball = 0.15 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + [0.5, 0, 1]
    write_points(tmp_path / "scan.xyz", np.concatenate([SCANNED, stray, ball]))
    lattice = fitted(model, tmp_path, "scan.xyz")
    found = errors(lattice, model.vertices)
    assert np.sqrt(np.mean(found**2)) < IN_SPACE
    assert found.max() < 2.5 * IN_SPACE
    report = lattice.fits[0].as_report()["scan"]
    assert report["points"] - report["used"] > 300
    assert any("points of the scan do not count" in text for text in lattice.warnings)


@pytest.mark.parametrize("name", ["model.obj", "points.xyz"])
def test_a_scan_that_is_in_place_moves_nothing(model, tmp_path, name):
    write_points(tmp_path / "points.xyz", model.vertices)
    lattice = fitted(model, tmp_path, name)
    np.testing.assert_array_equal(lattice.points, lattice.scaled(0).points)
    report = lattice.fits[0].as_report()["scan"]
    assert report["rounds"] == 1
    assert report["within_tolerance"] == 1


def test_places_on_the_sides_of_the_box_are_inside(tmp_path):
    """Between corners that numbers round, places are off the sides by their last digit."""
    random = np.random.default_rng(0)
    block = trimesh.creation.box(random.uniform(0.3, 3, 3)).subdivide().subdivide().subdivide()
    points = block.vertices + random.normal(size=3)
    model = read_mesh(write_mesh(tmp_path / "block.ply", points, block.faces))
    write_mesh(tmp_path / "scan.ply", points * [1.02, 1, 0.99], block.faces)
    lattice = fitted(model, tmp_path, "scan.ply")
    report = lattice.fits[0].as_report()["scan"]
    assert report["used"] > 0.98 * report["points"]
    assert report["coverage"] > 0.95
    assert report["scan_to_model"]["largest"] < NOISE


def test_the_same_scan_gives_the_same_lattice(model, tmp_path):
    write_points(tmp_path / "scan.xyz", SCANNED)
    first, second = (fitted(model, tmp_path, "scan.xyz") for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)


def test_the_unit_and_the_scale_of_the_scan_are_applied(model, tmp_path):
    write_points(tmp_path / "scan.xyz", SCANNED / 10)
    volume = f"unit: mm\n{NET}"
    there = fitted(model, tmp_path, "scan.xyz", ", unit: cm", volume)
    require_found(there, model.vertices)
    back = fitted(model, tmp_path, "scan.xyz", ", unit: cm, scale: -1", volume)
    moves = there.points - there.scaled(0).points
    np.testing.assert_allclose(back.points - back.scaled(0).points, -moves, atol=1e-3)


@pytest.mark.parametrize(
    ("points", "more", "words"),
    [
        (SCANNED + [20, 0, 0], "", "no surface of the scan lies within 0.5"),
        (SCANNED + [0, 0, 1.5], ", reach: 0.01", "its reach"),
        (np.linspace(SCANNED[0], SCANNED[1], 100), "", "lie on no surface"),
        (SCANNED[:1], "", "holds 1 point"),
        (np.full((50, 3), np.nan), "", "point 1 holds a number that is not finite"),
    ],
    ids=["far", "reach", "line", "point", "nan"],
)
def test_a_scan_of_nothing_near_is_refused_by_name(model, tmp_path, points, more, words):
    write_points(tmp_path / "scan.xyz", points)
    with pytest.raises(LatticeError, match=r"edits\[0\]\.fit\.target") as caught:
        fitted(model, tmp_path, "scan.xyz", more)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("tolerance: 1", "needs `pairs` or a `target`"),
        ("pairs: p.csv, target: scan.xyz", "has `pairs` and a `target`"),
        ("pairs: p.csv, reach: 1", "is for a scan as `target`"),
        ("target: scan.xyz, field: u", "is for pairs in a mesh file"),
        ("target: nothing.ply", "there is no such file"),
        ("target: scan.xyz, reach: 0", "reach"),
    ],
)
def test_keys_that_do_not_go_together(tmp_path, keys, words):
    write_points(tmp_path / "scan.xyz", SCANNED)
    text = f"version: 1\nedits:\n  - fit: {{{keys}}}\n"
    with pytest.raises(LatticeError, match="fit") as caught:
        parse_lattice(*parse_yaml(text, "l.yaml", tmp_path))
    assert words in str(caught.value)
