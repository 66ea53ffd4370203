"""3MF files: materials, names and digits, as the standard has them."""

from __future__ import annotations

import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from ffdcli.labels import Material
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io.painted_mesh import Paint, PaintedMesh
from ffdcli.mesh.io.write import write_mesh

PYRAMID = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.1, 1 / 3, 1e-7]], dtype=float)
SIDES = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
VERTICES = np.concatenate([PYRAMID, PYRAMID / 7 + 3])
TRIANGLES = np.concatenate([SIDES, SIDES + 5])
MATERIALS = (Material("signal <red>", (0.8, 0.2, 0.0)), Material("", (0.0, 0.2, 1.0)))
GROUPS = {'ba<se & "q" ä\x01': np.arange(6), "roof": np.array([2, 3]), "other": np.arange(6, 12)}
CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def tree_of(path):
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        for part in ("[Content_Types].xml", "_rels/.rels"):
            ElementTree.fromstring(archive.read(part))
        return ElementTree.fromstring(archive.read("3D/3dmodel.model"))


def colours_of(tree):
    """Colour of every triangle as the standard says: its own, else the body's; and the bodies."""
    bases = {
        (group.get("id"), str(n)): base.get("displaycolor")
        for group in tree.iter(CORE + "basematerials")
        for n, base in enumerate(group)
    }
    found = {}
    for body in tree.iter(CORE + "object"):
        points = [[float(v.get(a)) for a in "xyz"] for v in body.iter(CORE + "vertex")]
        default = (body.get("pid"), body.get("pindex"))
        for triangle in body.iter(CORE + "triangle"):
            own = (triangle.get("pid", default[0]), triangle.get("p1"))
            # Who gives a triangle a material must give the body one.
            assert triangle.get("p1") is None or None not in default
            corners = [points[int(triangle.get(v))] for v in ("v1", "v2", "v3")]
            key = tuple(np.mean(corners, axis=0).round(9).tolist())
            found[key] = (body.get("name"), bases.get(own if own[1] else default))
    return found


@pytest.mark.parametrize(
    "material",
    [
        [0, 0, 1, 1, 0, 1, 1, 1, 1, 1, 1, 0],
        [0, -1, 1, 1, -1, 0, 1, 1, -1, 1, 1, 1],
        [-1, -1, -1, -1, -1, -1, 0, 1, 1, 1, 0, 1],
        [1] * 12,
    ],
)
def test_colours_and_names(tmp_path, material):
    path = tmp_path / "p.3mf"
    paint = Paint(MATERIALS, np.array(material))
    written = write_mesh(path, PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, paint=paint))
    # No object may be open, as a part of a body is.
    assert written.unnamed == ("roof",)
    found = colours_of(tree_of(path))
    names = ['ba<se & "q" ä'] * 6 + ["other"] * 6
    for corners, name, number in zip(VERTICES[TRIANGLES], names, material, strict=True):
        body, colour = found[tuple(corners.mean(axis=0).round(9).tolist())]
        assert body == name
        beside = [m for n, m in zip(names, material, strict=True) if n == name]
        bare = None if max(beside) < 0 else "#B2B2B2"
        assert colour == {0: "#CC3300", 1: "#0033FF", -1: bare}[number]


def test_it_comes_back(tmp_path):
    path = tmp_path / "p.3mf"
    paint = Paint(MATERIALS, np.array([0, 0, 1, 0, 1, 1] * 2))
    write_mesh(path, PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, paint=paint, unit="inch"))
    mesh = read_mesh(path)
    assert mesh.unit == "inch"
    assert inspect(mesh).closed
    assert {tuple(row) for row in mesh.vertices.tolist()} == {tuple(v) for v in VERTICES.tolist()}
    assert {name: len(rows) for name, rows in mesh.groups.items()} == {
        'ba<se & "q" ä': 6,
        "other": 6,
    }
    assert [each.name for each in mesh.labels.materials] == ["signal <red>", "material"]
    assert [each.colour for each in mesh.labels.materials] == [m.colour for m in MATERIALS]
    middle = mesh.vertices[mesh.corners.reshape(-1, 3)].mean(axis=1)
    expected = VERTICES[TRIANGLES].mean(axis=1)
    order = [int(np.argmin(np.linalg.norm(expected - m, axis=1))) for m in middle]
    assert mesh.labels.material.tolist() == paint.material[order].tolist()


def test_a_second_reader_takes_it(tmp_path):
    path = tmp_path / "p.3mf"
    write_mesh(
        path,
        PaintedMesh(VERTICES, TRIANGLES, groups=GROUPS, paint=Paint(MATERIALS, np.zeros(12, int))),
    )
    scene = trimesh.load_scene(path, process=False)
    assert [len(part.faces) for part in scene.geometry.values()] == [6, 6]
    assert all(part.is_watertight for part in scene.geometry.values())
    whole = scene.to_mesh()
    assert whole.area == pytest.approx(trimesh.Trimesh(VERTICES, TRIANGLES).area, rel=1e-14)


def test_without_materials_there_are_none(tmp_path):
    write_mesh(tmp_path / "p.3mf", PaintedMesh(VERTICES, TRIANGLES))
    tree = tree_of(tmp_path / "p.3mf")
    assert not list(tree.iter(CORE + "basematerials"))
    assert {body.get("pid") for body in tree.iter(CORE + "object")} == {None}


def test_texture_coordinates_of_others_are_left_out_with_a_word(tmp_path):
    plain, textured = tmp_path / "p.3mf", tmp_path / "t.3mf"
    write_mesh(plain, PaintedMesh(VERTICES, TRIANGLES))
    group = (
        '<m:texture2dgroup xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"'
        ' id="9" texid="8"><m:tex2coord u="0.5" v="1"/></m:texture2dgroup></resources>'
    )
    with zipfile.ZipFile(plain) as old, zipfile.ZipFile(textured, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"</resources>", group.encode()))
    assert read_mesh(plain).notes == ()
    mesh = read_mesh(textured)
    assert mesh.uv is None
    assert mesh.notes == ("texture coordinates of 3MF files are left out",)
