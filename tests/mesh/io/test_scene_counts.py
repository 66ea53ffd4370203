"""COLLADA, 3DXML and XAML: what the file holds is what is read, or it is refused by name."""

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FileError
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io import scenes
from ffdcli.mesh.io.xml_scenes.count import count_scene
from support.damage import damage, require_read_or_refused
from support.scene_files import (
    FACES,
    PLACE,
    TRIANGLES,
    archive,
    collada,
    threedxml,
    xaml,
)

FILES = {
    "a.dae": collada(),
    "a.zae": archive(**{"a.dae": collada()}),
    "a.3dxml": threedxml(),
    "a.xaml": xaml(),
}
INPUTS = '<input semantic="VERTEX" source="#v" offset="0"/>'
INPUTS += INPUTS.replace("VERTEX", "NORMAL").replace('"0"', '"1"')
DOUBLED = " ".join(f"{corner} 0" for corner in FACES.split())


def counts(tmp_path, content, name="a.dae"):
    found = count_scene(content, tmp_path / name)
    return found.triangles, found.placed


def refusal(tmp_path, content, name="a.dae"):
    with pytest.raises(FileError) as caught:
        count_scene(content, tmp_path / name)
    assert caught.value.file == str(tmp_path / name)
    assert caught.value.hint
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", FILES)
def test_bodies_and_places(tmp_path, name):
    if name.endswith("ae"):
        pytest.importorskip("collada")
    path = tmp_path / name
    path.write_bytes(FILES[name])
    mesh = read_mesh(path)
    assert len(mesh.starts) - 1 == 8
    assert inspect(mesh).volumes.tolist() == pytest.approx([1 / 6, 1 / 6])
    assert mesh.bounds.tolist() == [[0, 0, 0], [6, 1, 1]]
    assert mesh.unit == {"a.xaml": None, "a.3dxml": "mm"}.get(name, "cm")


@pytest.mark.parametrize(
    ("primitives", "triangles"),
    [
        (TRIANGLES, 4),
        (TRIANGLES + TRIANGLES, 8),
        (f'<triangles count="4">{INPUTS}<p>{DOUBLED}</p></triangles>', 4),
        ('<polylist count="2"><input offset="0"/><vcount>4 3</vcount>'
         "<p>0 1 2 3 0 1 2</p></polylist>", 3),
        ('<polygons count="2"><input offset="0"/><p>0 1 2 3</p><p>0 1 2</p></polygons>', 3),
        ('<tristrips count="1"><input offset="0"/><p>0 1 2 3</p></tristrips>', 2),
        ('<trifans count="2"><input offset="0"/><p>0 1 2 3</p><p>1 2 3</p></trifans>', 3),
        (TRIANGLES + '<lines count="1"><input offset="0"/><p>0 1</p></lines>', 4),
    ],
)  # fmt: skip
def test_lists_of_polygons(tmp_path, primitives, triangles):
    assert counts(tmp_path, collada(primitives))[0] == 2 * triangles


def test_nodes_placed_many_times(tmp_path):
    # a holds the mesh twice, b holds a three times and the mesh once; the scene holds b twice.
    library = f'<node id="a">{PLACE}<node>{PLACE}</node></node>'
    of_a = '<instance_node url="#a"/>'
    library += f'<node id="b">{3 * of_a}{PLACE}</node>'
    nodes = '<node><instance_node url="#b"/></node><node><instance_node url="#b"/></node>'
    content = collada(nodes=nodes, library=library)
    assert counts(tmp_path, content) == (2 * 7 * 4, 2 * 7)
    if scenes.find_spec("collada"):
        (tmp_path / "a.dae").write_bytes(content)
        assert len(read_mesh(tmp_path / "a.dae").starts) - 1 == 56


def doubling(levels):
    nodes = f'<node id="n0">{PLACE}</node>'
    for level in range(levels):
        below = f'<instance_node url="#n{level}"/>'
        nodes += f'<node id="n{level + 1}">{2 * below}</node>'
    return collada(nodes=f'<node><instance_node url="#n{levels}"/></node>', library=nodes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (collada(nodes='<node><instance_geometry url="b.dae#g"/></node>'), "lies in another file"),
        (collada(nodes='<node><instance_geometry url="#h"/></node>'), "which it does not hold"),
        (collada(nodes='<node><instance_geometry url="#v"/></node>'), "which it does not hold"),
        (
            collada(nodes=2 * '<node><instance_controller url="#c"/></node>'),
            "2 meshes have skins or morph targets",
        ),
        (collada(nodes='<node id="n"><instance_node url="#n"/></node>'), "placed in itself"),
        (doubling(60), f"places {2**61 - 1 + 2**60 + 2} parts"),
        (doubling(1000), "at most 200000 are read"),
        (collada(TRIANGLES.replace("</triangles>", "<ph/></triangles>")), "has holes"),
        (collada(TRIANGLES.replace('"4"', '"5"')), "promises 5, but holds numbers for 4"),
        (collada(TRIANGLES.replace("0 2 1", "0 2")), "promises 4, but holds numbers for 3.66667"),
        (
            collada(
                '<polylist count="1"><input offset="0"/><vcount>4</vcount><p>0 1 2</p></polylist>'
            ),
            "4 corners by its sizes, but 3 are there",
        ),
        (collada(head='<!DOCTYPE a [<!ENTITY b "bbb">]>'), "document type"),
        (collada().replace(b"#r", b"#q"), "visual_scene 'q'"),
        (collada().replace(b"instance_visual_scene", b"nothing"), "shows no scene"),
        (collada()[:-20], "cannot be read as .dae"),
        (b"", "cannot be read as .dae"),
    ],
)
def test_collada_that_is_refused(tmp_path, content, words):
    assert words in refusal(tmp_path, content)


def test_archives_hold_one_document(tmp_path):
    assert counts(tmp_path, FILES["a.zae"], "a.zae") == (8, 2)
    two = archive(**{"a.dae": collada(), "b.dae": collada()})
    assert "holds 2 .dae files" in refusal(tmp_path, two, "a.zae")
    bomb = archive(**{"a.dae": collada(), "b.png": b"0" * 10**8})
    assert "unpacks to 100000000 bytes" in refusal(tmp_path, bomb, "a.zae")
    assert "no whole zip archive" in refusal(tmp_path, b"PK", "a.zae")


@pytest.mark.parametrize(
    ("faces", "triangles"),
    [
        (f'<Face triangles="{FACES}"/>', 4),
        ('<Face strips="0 1 2 3,0 1 2" fans="0 1 2 3"/>', 5),
        (f'<PolygonalLOD><Faces><Face triangles="{FACES}"/></Faces></PolygonalLOD>', 0),
    ],
)
def test_faces_of_3dxml(tmp_path, faces, triangles):
    assert counts(tmp_path, threedxml(faces), "a.3dxml")[0] == 2 * triangles


def test_faces_that_the_reader_of_3dxml_repeats_are_an_error(tmp_path):
    # trimesh returns the triangles of the first face of a list again with each further face.
    first, second = "0 2 1 0 1 3", "0 3 2 1 2 3"
    path = tmp_path / "a.3dxml"
    path.write_bytes(threedxml(f'<Face triangles="{first}"/><Face triangles="{second}"/>'))
    with pytest.raises(FileError, match=r"holds 8 triangles .* returns 12"):
        read_mesh(path)


def test_3dxml_that_is_refused(tmp_path):
    cycle = threedxml(instances=(("1", "3"), ("3", "1")))
    assert "placed in itself" in refusal(tmp_path, cycle, "a.3dxml")
    none = archive(**{"a.txt": ""})
    assert "no Manifest.xml" in refusal(tmp_path, none, "a.3dxml")
    other = '<ReferenceRep id="9" format="UVR" associatedFile="urn:3DXML:x"/>'
    notes = count_scene(threedxml(extra=other), tmp_path / "a.3dxml").notes
    assert notes == ("parts of the format 'UVR' are left out",)


def test_places_of_xaml(tmp_path):
    still = '<RotateTransform3D><RotateTransform3D.Rotation><AxisAngleRotation3D Angle="{}"/>'
    still += "</RotateTransform3D.Rotation></RotateTransform3D>"
    assert counts(tmp_path, xaml(still.format(0)), "a.xaml") == (8, None)
    for content in (
        xaml(still.format(9)),
        xaml('<TranslateTransform3D OffsetX="3"/>'),
        xaml().replace(b"ModelVisual3D.Transform", b"Model3DGroup.Transform"),
    ):
        assert "is no matrix of a `ModelVisual3D`" in refusal(tmp_path, content, "a.xaml")
    resource = xaml(geometry=' Geometry="{StaticResource a}"')
    assert "is a resource" in refusal(tmp_path, resource, "a.xaml")


def test_what_a_reader_loses_is_an_error_with_both_numbers(tmp_path):
    path = tmp_path / "a.dae"
    promised = count_scene(collada(), path)
    promised.require(8, 2, path)
    for triangles, placed in ((7, 2), (8, 1), (0, 0), (12, 3)):
        with pytest.raises(FileError, match=f"holds 8 .* in 2 .* returns {triangles} in {placed}"):
            promised.require(triangles, placed, path)


@pytest.mark.parametrize("name", FILES)
@settings(max_examples=60)
@given(data=st.data())
def test_damaged_scenes(tmp_path_factory, name, data):
    if name.endswith("ae"):
        pytest.importorskip("collada")
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(damage(FILES[name], data, (b"<", b">", b'"', b"#", b"nan", b"9" * 20, b"-")))
    require_read_or_refused(path)


@pytest.mark.parametrize("name", ["a.dae", "a.xaml"])
@settings(max_examples=60)
@given(data=st.data())
def test_damaged_counts(tmp_path_factory, name, data):
    """The counts end so without the reader too."""
    content = damage(FILES[name], data, (b"<", b">", b'"', b"#", b"nan", b"9" * 20, b"-"))
    found = None
    with contextlib.suppress(FileError):
        found = count_scene(content, tmp_path_factory.getbasetemp() / name)
    assert found is None or found.triangles >= 0
