"""3MF files: what is built comes in, each copy at its place; what cannot be read is refused."""

import itertools
import zipfile
from fractions import Fraction

import numpy as np
import pytest
import trimesh

from ffdcli.errors import FileError
from ffdcli.mesh import inspect, read_mesh
from support.threemf_files import (
    CORE,
    ROOT,
    assembly,
    box,
    matrix,
    model,
    relations,
    save,
    thing,
)

BESIDE = matrix(by=(50, 0, 0))
OTHER = "3D/Objects/o.model"
OF_OTHER = f'p:path="/{OTHER}" '
VOLUME = 10 * 20 * 30


@pytest.fixture
def read(tmp_path):
    """The mesh of a package; every body is closed and faces outwards, if ``closed``."""

    def run(*args, closed=True, **kwargs):
        mesh = read_mesh(save(tmp_path / "a.3mf", *args, **kwargs))
        found = inspect(mesh)
        assert found.closed == closed
        assert not closed or (found.volumes > 0).all()
        return mesh

    return run


@pytest.fixture
def refused(tmp_path):
    """The message and hint of a refusal."""

    def run(*args, **kwargs):
        with pytest.raises(FileError) as caught:
            read_mesh(save(tmp_path / "a.3mf", *args, **kwargs))
        assert caught.value.hint
        assert str(caught.value).isprintable()
        return caught.value.message

    return run


def volumes(mesh):
    return sorted(inspect(mesh).volumes.tolist())


def test_objects_of_other_parts(read):
    two = model(thing(1) + thing(2, box(at=(50, 0, 0))))
    both = assembly(3, OF_OTHER + 'objectid="1"', OF_OTHER + 'objectid="2"', stated='name="asm"')
    mesh = read(model(both, 'objectid="3"'), {OTHER: two})
    assert volumes(mesh) == pytest.approx([VOLUME, VOLUME])
    assert mesh.bounds.tolist() == [[0, 0, 0], [60, 20, 30]]
    assert mesh.labels.bodies == ("asm",)
    mesh = read(model(assembly(3, OF_OTHER + 'objectid="2"'), 'objectid="3"'), {OTHER: two})
    assert mesh.bounds.tolist() == [[50, 0, 0], [60, 20, 30]]
    assert mesh.notes == ("1 object that is not built is left out",)
    mesh = read(model("", 'objectid="1" ' + OF_OTHER), {OTHER: model(thing(1))})
    assert volumes(mesh) == pytest.approx([VOLUME])


def test_one_identifier_in_several_parts(read):
    parts = {"3D/a.model": model(thing(1)), "3D/b.model": model(thing(1, box((5, 5, 5))))}
    root = model(
        assembly(3, 'p:path="/3D/a.model" objectid="1"')
        + assembly(4, 'p:path="/3D/b.model" objectid="1"'),
        'objectid="3"',
        f'objectid="4" {BESIDE}',
    )
    assert volumes(read(root, parts)) == pytest.approx([125, VOLUME])


@pytest.mark.parametrize(
    "path",
    [
        "3D/Objects/o.model",
        "Objects/o.model",
        "\\3D\\Objects\\o.model",
        "/3d/objects/O.MODEL",
        "/3D/../3D/./Objects/o.model",
        "/3D/Objects/%6F.model",
    ],
)
def test_ways_to_name_a_part(read, path):
    root = model(
        assembly(1, f'p:path="{path}" objectid="7"', f'{OF_OTHER} objectid="7" {BESIDE}'),
        'objectid="1"',
    )
    assert volumes(read(root, {OTHER: model(thing(7))})) == pytest.approx([VOLUME, VOLUME])


def test_repeated_items_and_part_numbers(read):
    for title in ('partnumber="P1"', 'partnumber=""', ""):
        root = model(thing(1), f'objectid="1" {title}', f'objectid="1" {title} {BESIDE}')
        mesh = read(root)
        assert volumes(mesh) == pytest.approx([VOLUME, VOLUME])
        assert (mesh.labels and mesh.labels.bodies) == (("P1",) if "P1" in title else None)
    root = model(thing(1, stated='name="box"'), 'objectid="1"', f'objectid="1" {BESIDE}')
    assert read(root).labels.bodies == ("box",)


def test_names_whatever_they_are(read):
    names = ["12", "a&#9;b", "&lt;&amp;&quot;", "body", "ä\N{SNOWMAN}" * 5000]
    objects = [
        thing(n, box(at=(50 * n, 0, 0)), f'name="{name}"') for n, name in enumerate(names, start=1)
    ]
    mesh = read(model("".join(objects), *[f'objectid="{n}"' for n in range(1, 6)]))
    long = ("ä\N{SNOWMAN}" * 500)[:-1] + "…"
    assert mesh.labels.bodies == ("12", "a b", '<&"', "body", long)
    assert list(mesh.groups) == list(mesh.labels.bodies)


def test_nested_transforms_with_mirrors(read):
    """Places against exact arithmetic: rows times matrices, from the inside out."""
    steps = [
        (np.diag([-1, 1, 1]), (3, 0, 0)),
        (np.array([[0, -1, 0], [1, 0, 0], [0, 0, 2]]), (0, 5, 0)),
        (np.diag([1, 1, -0.5]), (100, 0, -7)),
    ]
    objects = thing(1, box((1, 2, 3)))
    for number, (linear, by) in enumerate(steps[:2], start=2):
        objects += assembly(number, f'objectid="{number - 1}" {matrix(linear, by)}')
    mesh = read(model(objects, f'objectid="3" {matrix(*steps[2])}'))
    expected = set()
    for corner in itertools.product((0, 1), (0, 2), (0, 3)):
        point = [Fraction(x) for x in corner]
        for linear, by in steps:
            rows = [[Fraction(float(x)) for x in row] for row in linear]
            point = [
                sum(map(lambda a, b: a * b, r, point)) + s for r, s in zip(rows, by, strict=True)
            ]
        expected.add(tuple(map(float, point)))
    assert set(map(tuple, mesh.vertices.tolist())) == expected
    assert volumes(mesh) == pytest.approx([6])


def test_an_object_at_many_places(read):
    """Three levels of four copies each: 64 boxes, none on another."""
    objects = thing(1, box((1, 1, 1)))
    for level in range(3):
        step = 2.0 * 4**level
        places = [f'objectid="{level + 1}" {matrix(by=(step * n, 0, 0))}' for n in range(4)]
        objects += assembly(level + 2, *places)
    mesh = read(model(objects, 'objectid="4"'))
    found = inspect(mesh)
    assert found.bodies == 64
    assert sorted(found.nesting.boxes[0, :, 0].tolist()) == [2.0 * n for n in range(64)]


def test_numbers_are_the_nearest_doubles(read):
    texts = ["0.1", "1e-3", "123456789.123456789", "+7", "1E2", "4.35", "0.30000000000000004"]
    corners = [(x, "0", "0") for x in texts] + [("0", "1", "0"), ("0", "0", "1")]
    points = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners)
    triangles = "".join(f'<triangle v1="{n}" v2="7" v3="8"/>' for n in range(7))
    content = f"<mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh>"
    mesh = read(model(thing(1, content), 'objectid="1"'), closed=False)
    assert set(mesh.vertices[:, 0].tolist()) == {0.0, *map(float, texts)}


def test_the_root_is_found_by_its_relation(read, tmp_path):
    decoy = {ROOT: model(thing(1, box((1, 1, 1))), 'objectid="1"')}
    mesh = read(model(thing(1), 'objectid="1"'), decoy, start="/3D/part.model")
    assert (volumes(mesh), mesh.notes) == (pytest.approx([VOLUME]), ())
    path = tmp_path / "b.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(ROOT, decoy[ROOT])
    mesh = read_mesh(path)
    assert volumes(mesh) == pytest.approx([1])
    assert mesh.notes == (f"the file does not say which part is its model: {ROOT} was read",)


@pytest.mark.parametrize("kind", ["support", "solidsupport", "other"])
def test_objects_that_are_no_part_of_the_model(read, refused, kind):
    support = thing(2, box(at=(0, 0, -30)), f'type="{kind}"')
    both = assembly(3, 'objectid="1"', 'objectid="2"', f'objectid="2" {BESIDE}')
    mesh = read(model(thing(1) + support + both, 'objectid="3"'))
    assert volumes(mesh) == pytest.approx([VOLUME])
    assert mesh.notes == (f"2 objects of type '{kind}' with 24 triangles are left out",)
    assert f"only objects of type '{kind}'" in refused(model(support, 'objectid="2"'))


def test_surfaces_and_items_not_to_be_printed_are_read(read):
    slicer = 'xmlns:s="http://schemas.slic3r.org/3mf/2017/06"'
    root = model(
        thing(1, stated='type="surface"'),
        'objectid="1"',
        f'objectid="1" printable="0" {BESIDE}',
        stated=slicer,
    )
    mesh = read(root)
    assert volumes(mesh) == pytest.approx([VOLUME, VOLUME])
    assert mesh.notes == ("1 item is marked as not printable, and read as well",)


@pytest.mark.parametrize(
    ("stated", "unit"),
    [
        ("", "mm"),
        *[(name, name) for name in ("mm", "cm", "m", "um")],
        ("micron", "um"),
        ("millimeter", "mm"),
        ("centimeter", "cm"),
        ("inch", "inch"),
        ("in", "inch"),
        ("foot", "ft"),
        ("Feet", "ft"),
        ("meter", "m"),
    ],
)
def test_units(read, stated, unit):
    mesh = read(model(thing(1), 'objectid="1"', unit=f'unit="{stated}"' if stated else ""))
    assert (mesh.unit, mesh.notes) == (unit, ())


def test_units_unknown_or_several(read, refused):
    mesh = read(model(thing(1), 'objectid="1"', unit='unit="furlong"'))
    assert mesh.unit is None
    assert "'furlong'" in mesh.notes[0]
    root = model(thing(1), 'objectid="1"', 'objectid="1" ' + OF_OTHER)
    assert "several units" in refused(root, {OTHER: model(thing(1), unit='unit="inch"')})
    # One unit by two names.
    read(root, {OTHER: model(thing(1, box(at=(50, 0, 0))), unit='unit="mm"')})


@pytest.mark.parametrize(
    ("resources", "items", "words"),
    [
        (thing(1), [], "nothing to build"),
        (thing(1), ['objectid="9"'], "names object '9'"),
        (thing(1), [""], "names object ''"),
        (assembly(1, 'objectid="7"'), ['objectid="1"'], "component 0 of object 1"),
        (assembly(1, f'{OF_OTHER} objectid="1"'), ['objectid="1"'], "'/3D/Objects/o.model'"),
        (thing(1), ['objectid="1" p:path="/../../etc/passwd"'], "does not have"),
        (thing(1) + thing(1), ['objectid="1"'], "two resources with the identifier '1'"),
        (
            '<basematerials id="1"/>' + thing(1),
            ['objectid="1"'],
            "two resources with the identifier '1'",
        ),
        (thing(""), ['objectid="1"'], "without an identifier"),
        (thing(1, ""), ['objectid="1"'], "neither a mesh nor components"),
        (thing(1, box() + box()), ['objectid="1"'], "two meshes"),
        (thing(1, "<mesh/>"), ['objectid="1"'], "no object has triangles"),
        (assembly(1, 'objectid="1"'), ['objectid="1"'], "component of itself"),
        (
            assembly(1, 'objectid="2"') + assembly(2, 'objectid="1"'),
            ['objectid="1"'],
            "component of itself",
        ),
        (
            thing(1, box().replace('v2="7"', 'v2="8"', 1)),
            ['objectid="1"'],
            "triangle 3 of object 1 of '3D/3dmodel.model' refers to vertex 8, of 8",
        ),
        (thing(1, box().replace('v1="0"', 'v1="-1"', 1)), ['objectid="1"'], "vertex -1, of 8"),
        (
            thing(1, box().replace('v1="0"', f'v1="{10**30}"', 1)),
            ['objectid="1"'],
            "a corner of triangle 0 of object 1",
        ),
        (thing(1, box().replace('v1="0"', 'v1="0.5"', 1)), ['objectid="1"'], "read: '0.5'"),
        (thing(1, box().replace('v1="0"', "", 1)), ['objectid="1"'], "read: ''"),
        (thing(1, box().replace('x="10"', "", 1)), ['objectid="1"'], "vertex 4 of object 1"),
        (thing(1, box().replace('x="10"', 'x="ten"', 1)), ['objectid="1"'], "read: 'ten'"),
        (
            thing(1, box().replace('x="10"', f'x="{"9" * 5000}"', 1)),
            ['objectid="1"'],
            "no number that can be read: '999",
        ),
        (thing(1), ['objectid="1" transform="1 0 0 0 1 0 0 0 nan 0 0 0"'], "twelve finite"),
        (thing(1), ['objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0"'], "twelve finite"),
        (
            thing(1),
            [f'objectid="1" transform="{"9" * 5000} 0 0 0 1 0 0 0 1 0 0 0"'],
            "twelve finite",
        ),
        (
            assembly(2, f'objectid="1" {matrix(np.eye(3) * 1e200)}') + thing(1),
            [f'objectid="2" {matrix(np.eye(3) * 1e200)}'],
            "not finite",
        ),
    ],
)
def test_what_is_not_there_or_no_number(refused, resources, items, words):
    assert words in refused(model(resources, *items))


def test_a_difference_of_counts_is_an_error(refused, monkeypatch):
    """A reader that loses a copy, or a triangle, is found out by the counts of the file."""
    from ffdcli.mesh.io.threemf import read as reader
    from ffdcli.mesh.io.threemf.rows import TriangleRows

    root = model(thing(1), 'objectid="1"', f'objectid="1" {BESIDE}')
    places = reader.find_places

    def lose_a_copy(contents):
        return {
            key: {names: [each[:1]] for names, (each,) in found.items()}
            for key, found in places(contents).items()
        }

    with monkeypatch.context() as patched:
        patched.setattr(reader, "find_places", lose_a_copy)
        words = "builds 2 meshes with 24 triangles, but 1 with 12 were read"
        assert words in refused(root)
    whole = TriangleRows.table
    monkeypatch.setattr(TriangleRows, "table", lambda self, count: whole(self, count)[1:])
    monkeypatch.setattr(TriangleRows, "paint", lambda self: np.zeros(11, dtype=np.int64))
    assert "builds 2 meshes with 24 triangles, but 2 with 22 were read" in refused(root)


BEAMS = 'xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"'
LATTICE = '<b:beamlattice radius="1"><b:beams><b:beam v1="0" v2="1"/></b:beams></b:beamlattice>'


def test_extensions(read, refused):
    lattice = box().replace("</mesh>", LATTICE + "</mesh>")
    mesh = read(model(thing(1, lattice), 'objectid="1"', stated=BEAMS))
    assert mesh.notes == (f"1 object has a beam lattice, which is not read: object 1 of '{ROOT}'",)
    empty = thing(2, "<mesh/>") + thing(3, "<mesh/>")
    mesh = read(model(thing(1) + empty, *[f'objectid="{n}"' for n in (3, 1, 2)]))
    assert mesh.notes == (f"2 objects have no triangles; the first is object 3 of '{ROOT}'",)
    required = BEAMS + ' requiredextensions="p b m"'
    message = refused(model(thing(1, lattice), 'objectid="1"', stated=required))
    assert "requires the extension" in message
    assert "beamlattice/2017/02'" in message
    assert "'zz'" in refused(model(thing(1), 'objectid="1"', stated='requiredextensions="zz"'))
    alone = f"<mesh><vertices/><triangles/>{LATTICE}</mesh>"
    message = refused(model(thing(1, alone), 'objectid="1"', stated=BEAMS))
    assert "a beam lattice, which is not read, and no triangles" in message
    read(model(thing(1), 'objectid="1"', stated='requiredextensions="p m"'))
    # An extension of a part counts as well.
    root = model("", 'objectid="1" ' + OF_OTHER)
    assert "beamlattice" in refused(root, {OTHER: model(thing(1), stated=required)})


def test_names_of_elements_may_have_prefixes(read):
    text = model(thing(1), 'objectid="1"')
    for name in ("model", "resources", "object", "mesh", "vertices", "vertex", "triangles"):
        text = text.replace(f"<{name} ", f"<c:{name} ").replace(f"<{name}>", f"<c:{name}>")
        text = text.replace(f"</{name}>", f"</c:{name}>")
    for name in ("triangle", "build", "item"):
        text = text.replace(f"<{name} ", f"<c:{name} ").replace(f"<{name}>", f"<c:{name}>")
        text = text.replace(f"</{name}>", f"</c:{name}>")
    # Elements of others, called alike, are none.
    text = text.replace(f'xmlns="{CORE}"', f'xmlns:c="{CORE}"')
    text = text.replace("<c:mesh>", "<mesh><triangle/></mesh><c:mesh><triangle/><vertex/>")
    assert volumes(read(text)) == pytest.approx([VOLUME])
    text = model(thing(1), 'objectid="1"').replace("UTF-8", "UTF-16").encode("utf-16")
    assert volumes(read(text)) == pytest.approx([VOLUME])


def test_relations_that_do_not_lead_to_one_model(refused, tmp_path):
    root = model(thing(1), 'objectid="1"')
    parts = {"_rels/.rels": relations("/3D/gone.model")}
    assert "'/3D/gone.model' is not in the file" in refused(root, parts)
    parts = {"_rels/.rels": relations("/" + ROOT, "/3D/b.model"), "3D/b.model": root}
    assert "2 root models" in refused(root, parts)
    outside = relations("http://a.b/c").replace("/>", ' TargetMode="External"/>')
    assert "outside of the file" in refused(root, {"_rels/.rels": outside})
    path = tmp_path / "b.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/part.model", root)
    with pytest.raises(FileError, match="which of its parts is the model"):
        read_mesh(path)
    assert "no 3MF model: its first element is 'html'" in refused("<html/>")


GROUPS = """
<basematerials id="5"><base name="steel" displaycolor="#808080"/>
<base name="glass" displaycolor="#00FF00"/></basematerials>
<m:colorgroup id="6"><m:color color="#FF0000"/></m:colorgroup>
<m:texture2dgroup id="7" texid="8"><m:tex2coord u="0" v="0"/></m:texture2dgroup>
<m:compositematerials id="9" matid="5" matindices="0 1"><m:composite values="0.3 0.7"/>
<m:composite values="0.5"/></m:compositematerials>
<m:multiproperties id="10" pids="7 9 6"><m:multi pindices="0 0 0"/><m:multi pindices="0 1"/>
</m:multiproperties><m:multiproperties id="11" pids="10 7 6"><m:multi pindices=""/>
</m:multiproperties>
"""


def test_materials_through_groups(read):
    stated = [
        ('pid="5" p1="1"', "glass"),
        ('pid="6" p1="0"', "#FF0000"),
        ('pid="7" p1="0"', ""),
        ('pid="9" p1="0"', "glass"),
        ('pid="9" p1="1"', "steel"),
        ('pid="10" p1="0"', "glass"),
        ('pid="10" p1="1"', "steel"),
        ('pid="11" p1="0"', "#FF0000"),
        ('p1="1"', "glass"),
        ('pid="5" p1="2"', ""),
        (f'pid="5" p1="{"1" * 5000}"', ""),
        ("", "steel"),
    ]
    body = thing(1, box(paint=[attributes for attributes, _ in stated]), 'pid="5" pindex="0"')
    mesh = read(model(GROUPS + body, 'objectid="1"'))
    names = [each.name for each in mesh.labels.materials] + [""]
    assert [names[n] for n in mesh.labels.material.tolist()] == [name for _, name in stated]
    assert mesh.labels.materials[0].colour == (128 / 255,) * 3
    assert mesh.notes == (
        "mixed materials are read as the material of their largest share",
        "texture coordinates of 3MF files are left out",
    )


def test_materials_are_those_of_the_part(read):
    """Identifiers of groups are of their part alone."""
    red = '<basematerials id="5"><base name="red" displaycolor="#FF0000"/></basematerials>'
    own = 'pid="5" pindex="0"'
    root = model(red + thing(1, stated=own), 'objectid="1"', f'objectid="1" {OF_OTHER} {BESIDE}')
    mesh = read(root, {OTHER: model(red.replace("red", "blue") + thing(1, stated=own))})
    names = [each.name for each in mesh.labels.materials]
    first = mesh.vertices[mesh.corners[mesh.starts[:-1]], 0]
    assert [names[n] for n in mesh.labels.material] == ["red" if x < 50 else "blue" for x in first]


def test_a_plain_file_against_trimesh(tmp_path):
    scene = trimesh.Scene()
    rng = np.random.default_rng(16)
    for number in range(3):
        body = trimesh.creation.icosphere(subdivisions=1)
        body.vertices *= rng.uniform(1, 2, 3)
        place = trimesh.transformations.random_rotation_matrix(rng.uniform(size=3))
        place[:3, 3] = [7 * number, 0, 0]
        scene.add_geometry(
            body, node_name=f"node {number}", geom_name=f"b{number}", transform=place
        )
    scene.export(tmp_path / "a.3mf")
    mesh = read_mesh(tmp_path / "a.3mf")
    other = trimesh.load_scene(tmp_path / "a.3mf", process=False)
    assert list(mesh.groups) == [f"node {number}" for number in range(3)]
    for name, rows in mesh.groups.items():
        place, geometry = other.graph[name]
        expected = other.geometry[geometry].copy().apply_transform(place)
        ours = mesh.vertices[mesh.corners.reshape(-1, 3)[rows]]
        np.testing.assert_allclose(ours, expected.triangles, rtol=0, atol=1e-12)
