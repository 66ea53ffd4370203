"""Mesh files: every format closed again when re-read, digits, names, units, whole or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.formats import MESH_FORMATS
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io.off import encode_off
from ffdcli.mesh.io.painted_mesh import PaintedMesh
from ffdcli.mesh.io.write import ENCODERS, write_mesh
from support.jobs import CUBE, CUBE_FACES

GROUPS = {"low part": np.array([0, 1]), "sides": np.arange(4, 12), "back": np.array([10, 11])}


@pytest.fixture
def points():
    """Coordinates with all their digits, some small, some negative."""
    return CUBE * [1.0, 2.0, 3.0] + np.random.default_rng(0).uniform(-0.3, 0.3, (8, 3)) - 0.5


@pytest.mark.parametrize("extension", MESH_FORMATS)
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_written_and_read_again(points, tmp_path, extension, scale):
    points = points * scale
    path = tmp_path / f"cube{extension}"
    written = write_mesh(path, PaintedMesh(points, CUBE_FACES, groups=GROUPS, unit="inch"))
    assert written.bytes == path.stat().st_size
    assert written.collapsed == 0
    mesh = read_mesh(path)
    assert inspect(mesh).closed
    assert mesh.polygon_count == 12
    assert len(mesh.vertices) == 8
    away = np.linalg.norm(mesh.vertices[:, None] - points, axis=2).min(axis=1).max()
    assert away <= written.rounding + 1e-15 * scale
    if extension in (".obj", ".off", ".3mf"):
        assert written.rounding == 0
    else:
        assert 0 < written.rounding <= 4 * 6e-8 * scale
    volume = inspect(mesh).volumes[0]
    corner = points[CUBE_FACES]
    expected = np.linalg.det(corner).sum() / 6
    assert volume == pytest.approx(expected, rel=1e-6)
    assert mesh.unit == {".3mf": "inch", ".glb": "m"}.get(extension)


def test_text_formats_keep_every_bit(points, tmp_path):
    for extension in (".obj", ".3mf"):
        write_mesh(tmp_path / f"cube{extension}", PaintedMesh(points, CUBE_FACES))
        again = read_mesh(tmp_path / f"cube{extension}").vertices
        assert {tuple(row) for row in again.tolist()} == {tuple(row) for row in points.tolist()}


@pytest.mark.parametrize("extension", [".obj", ".glb"])
def test_group_names(points, tmp_path, extension):
    path = tmp_path / f"cube{extension}"
    write_mesh(path, PaintedMesh(points, CUBE_FACES, groups=GROUPS, name="rest"))
    groups = read_mesh(path).groups
    counts = {name: len(members) for name, members in groups.items()}
    if extension == ".obj":
        assert counts == {"low_part": 2, "sides": 8, "back": 2}
    else:
        assert counts == {"rest": 2, "low part": 2, "sides": 6, "sides back": 2}


def test_names_that_are_alike_are_told_apart(points, tmp_path):
    groups = {"a b": np.array([0]), "a": np.array([1, 2]), "b": np.array([2])}
    write_mesh(tmp_path / "cube.glb", PaintedMesh(points, CUBE_FACES, groups=groups))
    found = read_mesh(tmp_path / "cube.glb").groups
    assert sorted(len(members) for members in found.values()) == [1, 1, 1, 9]


@pytest.mark.parametrize("extension", MESH_FORMATS)
def test_bytes_are_the_same_each_time(points, tmp_path, extension):
    first, second = tmp_path / f"a{extension}", tmp_path / f"b{extension}"
    for path in (first, second):
        write_mesh(path, PaintedMesh(points, CUBE_FACES, groups=GROUPS))
    assert first.read_bytes() == second.read_bytes()


def test_single_precision_far_from_the_origin_is_told(tmp_path):
    written = write_mesh(tmp_path / "far.stl", PaintedMesh(CUBE * 1e-3 + 1e6, CUBE_FACES))
    assert written.collapsed == 12
    assert written.rounding > 1e-4


@pytest.mark.parametrize(
    ("name", "unit", "message"),
    [
        ("cube.xyz", "mm", "cannot write a mesh of kind '.xyz'"),
        ("cube.3mf", "mile", "3MF files cannot be in the unit 'mile'"),
        ("none/cube.stl", "mm", "folder for this file does not exist"),
    ],
)
def test_refusals_leave_nothing(points, tmp_path, name, unit, message):
    with pytest.raises(FileError, match=message):
        write_mesh(tmp_path / name, PaintedMesh(points, CUBE_FACES, unit=unit))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_read_with_fewer_triangles_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "out.off"
    path.write_text("the old file")
    monkeypatch.setitem(ENCODERS, ".off", drop_a_triangle)
    points, triangles = np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]])
    with pytest.raises(FileError, match="would be read with 1 of 2 triangles"):
        write_mesh(path, PaintedMesh(points, triangles))
    assert path.read_text() == "the old file"


def drop_a_triangle(mesh, path):
    return encode_off(replace(mesh, triangles=mesh.triangles[1:]), path)
