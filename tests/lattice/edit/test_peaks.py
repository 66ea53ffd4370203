"""Hammers change the height of a peak alone, crimps its shape alone."""

import numpy as np
import pytest
import trimesh

from ffdcli import read_lattice
from ffdcli.errors import LatticeError
from ffdcli.lattice.edit.peaks import outward_normal
from support.jobs import ellipsoid

KINDS = {
    "bspline": "volume: bspline\npoints: [7, 7, 7]\n",
    "nurbs": "volume: nurbs\npoints: [7, 7, 7]\n",
    "tspline": "volume: tspline\noctree: {depth: 3}\n",
    "hierarchical": "volume: hierarchical\noctree: {depth: 2}\n",
}
TOP = [0.0, 0.0, 5.0]


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 3)


def images(tmp_path, mesh, kind, edits, points=None):
    path = tmp_path / "l.yaml"
    listed = "".join(f"  - {edit}\n" for edit in edits)
    path.write_text(f"version: 1\n{KINDS[kind]}edits:\n{listed}")
    lattice = read_lattice(path, mesh)
    return lattice.volume.evaluate(mesh.vertices if points is None else np.array(points))


RAISE = "move: {at: {near: [0.5, 0.2, 5]%s}, by: [0.2, -0.1, 2]}"


def raised(kind):
    return RAISE % (", level: 2" if kind == "hierarchical" else "")


@pytest.mark.parametrize("kind", KINDS)
def test_a_hammer_sets_the_height_and_keeps_the_profile(tmp_path, mesh, kind):
    before = images(tmp_path, mesh, kind, [raised(kind)]) - mesh.vertices
    edits = [raised(kind), f"hammer: {{point: {TOP}, height: 3}}"]
    after = images(tmp_path, mesh, kind, edits) - mesh.vertices
    at_top = images(tmp_path, mesh, kind, edits, [TOP])[0] - TOP
    first = images(tmp_path, mesh, kind, edits[:1], [TOP])[0] - TOP
    assert abs(np.linalg.norm(at_top) - 3) < 1e-13
    profile, again = before / np.linalg.norm(first), after / 3
    assert np.abs(profile).max() > 0.5
    assert np.abs(again - profile).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_a_hammer_on_nothing_raises_along_the_normal(tmp_path, mesh, kind):
    corner = mesh.vertices[100]
    edits = [f"hammer: {{point: {corner.tolist()}, height: 0.8}}"]
    moved = images(tmp_path, mesh, kind, edits, [corner])[0] - corner
    normal = trimesh.Trimesh(mesh.vertices, mesh.corners.reshape(-1, 3)).vertex_normals[100]
    assert abs(np.linalg.norm(moved) - 0.8) < 1e-12
    assert moved @ normal > 0.79


def test_what_cannot_be_hammered_or_crimped(tmp_path, mesh):
    with pytest.raises(LatticeError, match="no peak"):
        images(tmp_path, mesh, "nurbs", [f"crimp: {{point: {TOP}, sharpness: 2}}"])
    with pytest.raises(LatticeError, match="has no weights"):
        images(tmp_path, mesh, "bspline", [f"crimp: {{point: {TOP}, sharpness: 2}}"])
    with pytest.raises(LatticeError, match="outside the lattice box"):
        images(tmp_path, mesh, "nurbs", ["hammer: {point: [99, 0, 0], height: 2}"])
    with pytest.raises(LatticeError, match=r"must be at least 0\.01"):
        images(tmp_path, mesh, "nurbs", [f"crimp: {{point: {TOP}, sharpness: 0}}"])


def test_a_hammer_that_only_locked_points_reach_says_what_to_do(tmp_path, mesh):
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    room = (high - low) / 10
    box = f"{{min: {(low + room).tolist()}, max: {(high - room).tolist()}}}"
    point = (low + [1.1, 5, 5] * room).tolist()
    path = tmp_path / "l.yaml"
    path.write_text(
        f"version: 1\ndegree: [3, 3, 3]\npoints: [9, 4, 4]\nbox: {box}\n"
        f"edits:\n  - hammer: {{point: {point}, height: 1}}\n"
    )
    with pytest.raises(LatticeError, match="no control point that may move") as caught:
        read_lattice(path, mesh)
    assert caught.value.hint is not None
    assert "on_conflict" not in caught.value.hint


def test_the_nearest_triangle_gives_the_normal():
    roof = np.array(
        [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 1], [1, 0, 0]]], dtype=float
    )
    assert outward_normal(roof, np.array([0.2, 0.3, 0.01])).tolist() == [0, 0, 1]
    on_edge = outward_normal(roof, np.array([0.5, 0.0, 0.0]))
    assert np.allclose(on_edge, np.array([0, 1, 1]) / np.sqrt(2))
    beyond = outward_normal(roof, np.array([0.2, 2.0, -0.5]))
    assert beyond.tolist() == [0, 0, 1]
