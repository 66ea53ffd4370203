"""Texture coordinates of mesh output, read back by trimesh and by ourselves."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from ffdcli.labels import Material
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io.painted_mesh import UNPAINTED, Paint, PaintedMesh
from ffdcli.mesh.io.write import write_mesh

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float)
TRIANGLES = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
# The sides lie one beside the other, with a seam between the last and the first; the base is apart.
ROUND = np.array([[[n, 0.1], [n + 1, 0.1], [n + 0.5, 1 / 3]] for n in range(4)]) / [4, 1]
BASE = 0.5 + VERTICES[TRIANGLES[:2]][:, :, :2] / 3
UV = np.concatenate([BASE, ROUND])
GROUPS = {"base": np.array([0, 1]), "roof": np.array([2, 3, 4, 5])}
PAINT = Paint((Material("red", (0.8, 0.1, 0.1)),), np.array([-1, -1, 0, 0, 0, 0]))


def corner_places(points, faces, uv):
    """(T, 3, 5) places of corners in space and in the texture, of triangles in a fixed order."""
    rows = np.concatenate([points[faces], uv], axis=2)
    # Each from its least corner on, then by that and the next ones.
    begin = [min(range(3), key=lambda k, row=row: tuple(np.round(row[k], 6))) for row in rows]
    rows = np.stack([np.roll(row, -k, axis=0) for row, k in zip(rows, begin, strict=True)])
    return rows[np.lexsort(np.round(rows.reshape(len(rows), -1), 6).T)]


WANTED = corner_places(VERTICES, TRIANGLES, UV)


@pytest.mark.parametrize("extension", ["obj", "ply", "glb"])
@pytest.mark.parametrize("paint", [UNPAINTED, PAINT], ids=["bare", "painted"])
def test_a_second_reader_sees_them(tmp_path, extension, paint):
    path = tmp_path / f"p.{extension}"
    write_mesh(path, PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, paint=paint, uv=UV))
    # trimesh drops the texture of OBJ files and GLB parts that have no material.
    if extension == "obj" and not paint.materials:
        path.write_text("usemtl any\n" + path.read_text())
    scene = trimesh.load_scene(path, process=False)
    parts = list(scene.geometry.values())
    found = np.concatenate(
        [
            np.concatenate([p.vertices[p.faces], np.asarray(p.visual.uv)[p.faces]], axis=2)
            for p in parts
            if getattr(p.visual, "uv", None) is not None
        ]
    )
    rows = corner_places(found[:, :, :3].reshape(-1, 3), np.arange(3 * len(found)).reshape(-1, 3),
                         found[:, :, 3:])  # fmt: skip
    np.testing.assert_allclose(rows, WANTED, atol=1e-6)


@pytest.mark.parametrize("extension", ["obj", "ply", "glb"])
def test_they_come_back_and_the_mesh_is_closed(tmp_path, extension):
    path = tmp_path / f"p.{extension}"
    written = write_mesh(path, PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, paint=PAINT, uv=UV))
    assert written.collapsed == 0
    mesh = read_mesh(path)
    assert inspect(mesh).closed
    assert len(mesh.vertices) == 5
    rows = corner_places(mesh.vertices, mesh.corners.reshape(-1, 3), mesh.uv.reshape(-1, 3, 2))
    np.testing.assert_allclose(rows, WANTED, atol=0 if extension == "obj" else 1e-7)


def test_seams_part_vertices_only_where_they_are(tmp_path):
    write_mesh(tmp_path / "p.ply", PaintedMesh(VERTICES, TRIANGLES, uv=UV))
    read = trimesh.load_mesh(tmp_path / "p.ply", process=False)
    # Four of the base; five below and four tips on the sides.
    assert len(read.vertices) == 13


def test_ply_keeps_colours_beside_them(tmp_path):
    write_mesh(tmp_path / "p.ply", PaintedMesh(VERTICES, TRIANGLES, uv=UV, paint=PAINT))
    header = (tmp_path / "p.ply").read_bytes().partition(b"end_header")[0]
    assert b" s\n" in header
    assert b" t\n" in header
    assert b" red\n" in header


@pytest.mark.parametrize("extension", ["obj", "ply", "glb"])
def test_triangles_that_have_none(tmp_path, extension):
    uv = UV.copy()
    uv[[1, 4]] = np.nan
    write_mesh(tmp_path / f"p.{extension}", PaintedMesh(VERTICES, TRIANGLES, uv=uv))
    mesh = read_mesh(tmp_path / f"p.{extension}")
    found = mesh.uv.reshape(-1, 3, 2)
    if extension == "obj":
        assert np.isnan(found).all(axis=(1, 2)).tolist() == [False, True, False, False, True, False]
    else:
        assert np.count_nonzero((found == 0).all(axis=(1, 2))) == 2


def test_groups_without_any_have_none_in_glb(tmp_path):
    uv = UV.copy()
    uv[:2] = np.nan
    write_mesh(tmp_path / "p.glb", PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, uv=uv))
    mesh = read_mesh(tmp_path / "p.glb")
    bare = np.isnan(mesh.uv[mesh.starts[:-1], 0])
    assert np.flatnonzero(bare).tolist() == mesh.groups["base"].tolist()


def test_an_image_is_named_from_where_the_file_is(tmp_path):
    for name in ("in", "out"):
        (tmp_path / name).mkdir()
    image = str(tmp_path / "in" / "wood grain.png")
    paint = Paint((Material("wood", (1.0, 1.0, 1.0), image),), np.zeros(6, dtype=np.int64))
    write_mesh(tmp_path / "out" / "p.obj", PaintedMesh(VERTICES, TRIANGLES, paint=paint, uv=UV))
    text = (tmp_path / "out" / "p.mtl").read_text()
    assert "map_Kd ../in/wood grain.png\n" in text
    (again,) = read_mesh(tmp_path / "out" / "p.obj").labels.materials
    assert (tmp_path / again.image).resolve() == (tmp_path / "in" / "wood grain.png").resolve()
