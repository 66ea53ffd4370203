"""Materials and colours of mesh output, read back by our own readers and by trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from ffdcli import read_mesh
from ffdcli.labels import Material
from ffdcli.mesh.io.painted_mesh import Paint, PaintedMesh, split_parts
from ffdcli.mesh.io.write import write_mesh

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float)
TRIANGLES = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
RED, BLUE = Material("signal red", (0.8, 0.1, 0.1)), Material("blue", (0.1, 0.2, 0.9))
PAINT = Paint((RED, BLUE), np.array([0, -1, 1, 1, -1, 0]))


def colours_by_middle(mesh):
    """Colour of each triangle of a mesh of ours, by its middle."""
    middles = mesh.vertices[mesh.corners.reshape(-1, 3)].mean(axis=1)
    materials = mesh.labels.materials
    return {
        tuple(np.round(middle, 5)): None if number < 0 else materials[number].colour
        for middle, number in zip(middles, mesh.labels.material.tolist(), strict=True)
    }


@pytest.mark.parametrize("name", ["p.obj", "p.glb"])
def test_materials_come_back(tmp_path, name):
    groups = {"base": np.array([0, 1]), "roof": np.array([2, 3, 4, 5])}
    write_mesh(tmp_path / name, PaintedMesh(VERTICES, TRIANGLES, groups=groups, paint=PAINT))
    mesh = read_mesh(tmp_path / name)
    found = colours_by_middle(mesh)
    middles = VERTICES[TRIANGLES].mean(axis=1)
    for middle, number in zip(middles, PAINT.material.tolist(), strict=True):
        colour = found[tuple(np.round(middle, 5))]
        if number < 0:
            assert colour is None
        else:
            assert colour == pytest.approx(PAINT.materials[number].colour, abs=0.02)
    assert {each.name for each in mesh.labels.materials} >= {"blue"}


def test_ply_has_the_colours(tmp_path):
    write_mesh(tmp_path / "p.ply", PaintedMesh(VERTICES, TRIANGLES, paint=PAINT))
    read = trimesh.load_mesh(tmp_path / "p.ply", process=False)
    wanted = np.round(255 * np.array([RED.colour, BLUE.colour, BLUE.colour]))
    assert np.array_equal(read.visual.face_colors[[0, 2, 3], :3], wanted)


def test_without_materials_no_library_is_written(tmp_path):
    write_mesh(tmp_path / "p.obj", PaintedMesh(VERTICES, TRIANGLES))
    assert [path.name for path in tmp_path.iterdir()] == ["p.obj"]
    assert "usemtl" not in (tmp_path / "p.obj").read_text()


def test_many_groups_are_parted_without_a_table_of_all():
    count = 100_000
    groups = {f"g{n}": np.array([n, (n + 1) % count]) for n in range(count)}
    mesh = PaintedMesh(np.zeros((3, 3)), np.zeros((count, 3), dtype=np.int64), groups)
    parts = split_parts(mesh)
    assert [names for names in parts.names if "g7" in names] == [["g7", "g8"], ["g6", "g7"]]
    assert sorted(np.concatenate(parts.triangles)) == list(range(count))
