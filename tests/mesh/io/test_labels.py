"""Names and colours of bodies, groups and materials, as the files have them."""

import json
import zipfile

import numpy as np
import pytest
import trimesh

from ffdcli.labels import Material
from ffdcli.mesh import read_mesh

CORNERS = [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 1) for x in (0, 1)]

THREEMF = """<?xml version="1.0"?>
<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><resources>
<basematerials id="5"><base name="Red" displaycolor="#FF0000"/></basematerials>
<m:colorgroup id="6"><m:color color="#0033FFFF"/></m:colorgroup>
<object id="1" name="Wedge" type="model" pid="5" pindex="0"><mesh><vertices>
<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
<vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3" pid="6" p1="0"/><triangle v1="1" v2="2" v3="3" pid="9" p1="0"/>
<triangle v1="0" v2="3" v3="2" p1="7"/></triangles></mesh></object>
</resources><build><item objectid="1"/></build></model>"""


def names_of(labels, kind, each):
    """Name of every polygon's body, group or material."""
    named = [getattr(entry, "name", entry) for entry in getattr(labels, kind)] + [""]
    return [named[number] for number in getattr(labels, each).tolist()]


def test_obj_names_and_colours(tmp_path):
    (tmp_path / "my paint.mtl").write_bytes(
        b"newmtl wet paint#2\r\n  Kd 0.25 0.5 1\nKs 1 1 1\n# newmtl no\nnewmtl bare\nillum 2\n"
        b"newmtl odd\nKd spectral file.rfl\n"
    )
    lines = [
        "mtllib my paint.mtl",
        *CORNERS,
        "f 1 3 4 2",
        "o Left box # the left one",
        "g base walls",
        "usemtl wet paint#2",
        "f 1 2 6 5",
        "usemtl bare",
        "f 3 7 8 4",
        "g",
        "usemtl odd",
        "f 5 6 8 7",
    ]
    path = tmp_path / "box.obj"
    path.write_text("\n".join([*lines, ""]))
    mesh = read_mesh(path)
    labels = mesh.labels
    assert mesh.notes == ()
    assert names_of(labels, "bodies", "body") == ["", "Left box", "Left box", "Left box"]
    assert names_of(labels, "groups", "group") == ["", "base walls", "base walls", ""]
    assert names_of(labels, "materials", "material") == ["", "wet paint#2", "bare", "odd"]
    assert labels.materials == (
        Material("wet paint#2", (0.25, 0.5, 1.0)),
        Material("bare"),
        Material("odd"),
    )
    assert list(mesh.groups) == ["base", "walls", "Left box"]


def test_labels_follow_polygons_that_are_split(tmp_path):
    path = tmp_path / "bent.obj"
    corners = ["v 0 0 0", "v 1 0 0", "v 1 1 0.2", "v 0 1 0", "v 2 0 0", "v 2 1 0"]
    faces = ["usemtl a", "f 1 2 3 4", "usemtl b", "f 2 5 3", "f 5 6 3"]
    path.write_text("\n".join([*corners, *faces, ""]))
    mesh = read_mesh(path)
    assert names_of(mesh.labels, "materials", "material") == ["a", "a", "b", "b"]


def test_no_names_no_labels(tmp_path):
    path = tmp_path / "plain.obj"
    path.write_text("\n".join([*CORNERS, "f 1 3 4 2", ""]))
    assert read_mesh(path).labels is None
    path = tmp_path / "plain.stl"
    trimesh.creation.box().export(path)
    assert read_mesh(path).labels is None


@pytest.mark.parametrize("extension", ["glb", "gltf"])
def test_gltf_nodes_and_linear_colours(tmp_path, extension):
    scene = trimesh.Scene()
    for place, (name, factor) in enumerate([("rust", [0.5, 0.2, 0]), ("sky", [0, 0.001, 1])]):
        material = trimesh.visual.material.PBRMaterial(name=name, baseColorFactor=[*factor, 1.0])
        box = trimesh.creation.box().apply_translation([3 * place, 0, 0])
        box.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(box, node_name=f"Box of {name}", geom_name=name)
    path = tmp_path / f"two.{extension}"
    if extension == "glb":
        path.write_bytes(scene.export(file_type="glb"))
    else:
        for name, content in scene.export(file_type="gltf").items():
            (tmp_path / name.replace("model.gltf", path.name)).write_bytes(content)
    mesh = read_mesh(path)
    painted = names_of(mesh.labels, "materials", "material")
    bodies = names_of(mesh.labels, "bodies", "body")
    assert {body: name for body, name in zip(bodies, painted, strict=True)} == {
        "Box of rust": "rust",
        "Box of sky": "sky",
    }
    # Coordinates tell the boxes apart, whatever their order.
    first = mesh.vertices[mesh.corners[mesh.starts[:-1]], 0]
    assert [x > 1 for x in first] == [name == "sky" for name in painted]
    stored = json.loads(scene.export(file_type="gltf")["model.gltf"])["materials"]
    for material in mesh.labels.materials:
        linear = next(each for each in stored if each["name"] == material.name)
        linear = np.array(linear["pbrMetallicRoughness"]["baseColorFactor"][:3])
        shown = np.array(material.colour)
        decoded = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(decoded, linear, atol=1e-6)


def test_gltf_primitives_of_one_mesh_are_one_body(tmp_path):
    box = trimesh.creation.box()
    halves = [box.submesh([range(6)], append=True), box.submesh([range(6, 12)], append=True)]
    for half, name in zip(halves, ("lower", "upper"), strict=True):
        material = trimesh.visual.material.PBRMaterial(name=name)
        half.visual = trimesh.visual.TextureVisuals(material=material)
    scene = trimesh.Scene()
    for name, half in zip("ab", halves, strict=True):
        scene.add_geometry(half, node_name=name, geom_name=name)
    files = scene.export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    parts = [mesh["primitives"][0] for mesh in tree["meshes"]]
    tree["meshes"] = [{"name": "whole", "primitives": parts}]
    tree["nodes"] = [{"name": "Crate", "mesh": 0}]
    tree["scenes"] = [{"nodes": [0]}]
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "crate.gltf"
    path.write_text(json.dumps(tree))
    mesh = read_mesh(path)
    assert names_of(mesh.labels, "bodies", "body") == ["Crate"] * 12
    assert sorted(names_of(mesh.labels, "materials", "material")) == ["lower"] * 6 + ["upper"] * 6
    assert mesh.groups == {}


def test_3mf_base_materials_and_colour_groups(tmp_path):
    path = tmp_path / "wedge.3mf"
    relations = "http://schemas.openxmlformats.org/package/2006/relationships"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", THREEMF)
        archive.writestr("_rels/.rels", f'<Relationships xmlns="{relations}"/>')
    mesh = read_mesh(path)
    assert mesh.unit == "inch"
    assert names_of(mesh.labels, "bodies", "body") == ["Wedge"] * 4
    # A group or a place in it that is not there is no colour.
    assert names_of(mesh.labels, "materials", "material") == ["Red", "#0033FFFF", "", ""]
    assert [material.colour for material in mesh.labels.materials] == [(1, 0, 0), (0, 0.2, 1)]
