"""Scenes that trimesh reads: places, groups, textures and units."""

import numpy as np
import pytest
import trimesh

from ffdcli.errors import FileError, MeshError
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io import scenes
from ffdcli.mesh.io.xml_scenes.tally import SceneCounts

UNMOVED = np.eye(4)


@pytest.fixture
def read(tmp_path, monkeypatch):
    """The mesh of a scene, as if a COLLADA file held it: its reader need not be installed."""

    def run(scene):
        monkeypatch.setattr(trimesh, "load_scene", lambda *_, **__: scene)
        names = [scene.graph[node][1] for node in scene.graph.nodes_geometry]
        triangles = sum(len(getattr(scene.geometry[name], "faces", ())) for name in names)
        promised = SceneCounts(triangles, None)
        monkeypatch.setattr(scenes, "find_spec", lambda _: True)
        monkeypatch.setattr(scenes, "count_scene", lambda *_: promised)
        path = tmp_path / "a.dae"
        path.write_text("")
        return read_mesh(path)

    return run


def scene_of(units, transforms=(UNMOVED, UNMOVED)):
    scene = trimesh.Scene()
    for number, (unit, transform) in enumerate(zip(units, transforms, strict=True)):
        body = trimesh.creation.box(bounds=[[0, 0, 0], [1, 2, 3]])
        body.metadata["units"] = unit
        shift = trimesh.transformations.translation_matrix([9 * number, 0, 0])
        scene.add_geometry(body, node_name=f"n{number}", transform=shift @ transform)
    return scene


def test_places_and_groups(read):
    mirror = np.diag([1.0, -2, 1, 1])
    mesh = read(scene_of(["mm", "mm"], [UNMOVED, mirror]))
    assert inspect(mesh).closed
    assert inspect(mesh).volumes.tolist() == pytest.approx([6, 12])
    assert mesh.bounds.tolist() == [[0, -4, 0], [10, 2, 3]]
    assert {name: len(rows) for name, rows in mesh.groups.items()} == {"n0": 12, "n1": 12}
    assert mesh.labels is None


def test_textures_of_some(read):
    scene = scene_of([None, None])
    body = scene.geometry[scene.graph["n1"][1]]
    uv = np.arange(16.0).reshape(8, 2)
    body.visual = trimesh.visual.TextureVisuals(uv=uv)
    mesh = read(scene)
    second = mesh.groups["n1"]
    assert np.isnan(mesh.uv.reshape(-1, 3, 2)[mesh.groups["n0"]]).all()
    assert mesh.uv.reshape(-1, 3, 2)[second].tolist() == uv[body.faces].tolist()


@pytest.mark.parametrize(
    ("stated", "unit"),
    [("m", "m"), ("cm", "cm"), ("in", "inch"), ("inches", "inch"), ('"', "inch"), ("'", "ft"),
     ("feet", "ft"), ("miles", "mile"), ("microns", "um"), ("millimeter", "mm"),
     ("0.0254 * meters", "inch"), ("0.01 * meters", "cm"), ("0.001 * meters", "mm"),
     ("1000.0 * meters", "km"), ("0.3048 * meters", "ft"), ("1e-06 * meters", "um"),
     (None, None)],
)  # fmt: skip
def test_units(read, stated, unit):
    mesh = read(scene_of([stated, stated]))
    assert (mesh.unit, mesh.notes) == (unit, ())


@pytest.mark.parametrize("stated", ["yards", "0.5 * meters", ". * meters", "\x1b[31m", "x" * 500])
def test_unknown_units_are_said(read, stated):
    mesh = read(scene_of([stated, stated]))
    assert mesh.unit is None
    assert "is not known here" in mesh.notes[0]
    assert mesh.notes[0].isprintable()
    assert len(mesh.notes[0]) < 120


@pytest.mark.parametrize("units", [("mm", "in"), ("mm", None), ("yards", "furlongs")])
def test_several_units_are_refused(read, units):
    with pytest.raises(FileError, match="several units"):
        read(scene_of(units))


def test_one_unit_by_two_names(read):
    assert read(scene_of(["mm", "millimeters"])).unit == "mm"


def test_points_are_left_out_with_a_word(read):
    scene = scene_of(["mm", "mm"])
    scene.add_geometry(trimesh.PointCloud(np.eye(3)), node_name="points")
    mesh = read(scene)
    assert (mesh.polygon_count, mesh.unit) == (24, "mm")
    assert mesh.notes == ("parts without triangles are left out",)


def test_nothing_but_points(read):
    with pytest.raises(MeshError, match="no polygons"):
        read(trimesh.Scene([trimesh.PointCloud(np.eye(3))]))
