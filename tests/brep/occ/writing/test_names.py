"""Names of any characters: written, read again by OpenCascade, and found equal or cut."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.brep.labels import BodyLabels, ShapeLabels
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.iges import iges_bytes
from ffdcli.brep.occ.writing.step import step_bytes
from ffdcli.labels import Material, plain_names
from ffdcli.mesh.io.painted_mesh import Paint, PaintedMesh
from ffdcli.mesh.io.write import write_mesh
from support import brep_models as models

# Kinds of entities that carry the name: part, body, face, layer.
NAMED = (
    "StepBasic_Product",
    "StepShape_ManifoldSolidBrep",
    "StepShape_AdvancedFace",
    "StepVisual_PresentationLayerAssignment",
)
PIECES = st.sampled_from(
    [
        "'",
        "''",
        "(",
        ")",
        ",",
        ";",
        "/*",
        "*/",
        "\\",
        "\\X2\\",
        "\\X0\\",
        "\\S\\",
        "\\N\\",
        '"',
        " ",
    ]
    + ["\n", "\r", "\0", "\t", "\x1e1\x1e", "#1=", "ENDSEC;", "5H", "é", "Ω", "字", "😀", "\u202e"]
    + ["\ud800", "\udc00", "\uffff", "\u2028", "a" * 70, "ab " * 30, "字" * 20, "😀" * 9]
)
NAMES = st.one_of(
    st.text(min_size=1, max_size=40), st.lists(PIECES, min_size=1, max_size=30).map("".join)
)


def held(name, longest):
    """The name as files hold it, by the words of the reference."""
    for character in {c for c in name if ord(c) < 32 or 127 <= ord(c) < 160} | {"\u2028", "\u2029"}:
        name = name.replace(character, " ")
    odd = {c for c in name if 0xD800 <= ord(c) < 0xE000} | {"\ufffe", "\uffff"}
    name = "".join("\ufffd" if c in odd else c for c in name)
    return name if len(name) <= longest else name[: longest - 1] + "…"


def step_entities(content, path):
    """Entities as OpenCascade reads them: for each the type, and the entity."""
    from OCP.STEPControl import STEPControl_Reader

    path.write_bytes(content)
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    assert reader.TransferRoots() == 1
    model = reader.WS().Model()
    entities = [model.Value(number) for number in range(1, model.NbEntities() + 1)]
    return [(type(entity).__name__, entity) for entity in entities]


@settings(max_examples=60)
@given(name=NAMES)
@example(name="beam (5')")
@example(name="x', y")
@example(name="'\" )")
@example(name="'" * 100)
@example(name="x" * 20_000)
@example(name="'),a" * 5_000)
@example(name="é😀" * 10_000)
@example(name="日本語のとても長い名前" * 9)
def test_step_names_come_back(name, tmp_path_factory):
    right = held(name, 1800)
    face = BodyLabels(name, faces=(name,) * 6, materials=(0,) * 6)
    labels = ShapeLabels(name, (Material(name, (1, 0, 0)),), (face,))
    header = FileHeader(name, name, name, name)
    content = step_bytes(build_shape(models.cube()), name, labels=labels, header=header)
    assert all(byte == 10 or 32 <= byte < 127 for byte in set(content))
    entities = step_entities(content, tmp_path_factory.getbasetemp() / "name.step")
    found = [each.Name() for kind, each in entities if kind in NAMED]
    assert len(found) == 9
    assert {each.ToCString() if each else "" for each in found} == {right}


def test_step_names_in_the_header_and_of_people_come_back(tmp_path):
    name = "O'Neil (5'), 字" * 3
    header = FileHeader(author=name, organisation=name)
    content = step_bytes(build_shape(models.cube()), name, schema="ap203", header=header)
    entities = step_entities(content, tmp_path / "name.step")
    people = [each for kind, each in entities if kind == "StepBasic_Person"]
    assert {each.LastName().ToCString() for each in people} == {name}
    head = content[: content.index(b"ENDSEC;")].decode()
    assert head.count("O''Neil (5\\X2\\0027\\X0\\), \\X2\\5B57\\X0\\O''Neil") == 3


@settings(max_examples=40)
@given(name=NAMES)
@example(name="1H,;,")
@example(name="x" * 20_000)
def test_iges_files_are_read_whatever_the_name(name, tmp_path_factory):
    from OCP.IGESControl import IGESControl_Reader

    path = tmp_path_factory.getbasetemp() / "name.igs"
    labels = ShapeLabels(name, (), (BodyLabels(name),))
    content = iges_bytes(
        build_shape(models.cube()), name, labels=labels, header=FileHeader(name, name, name)
    )
    path.write_bytes(content)
    reader = IGESControl_Reader()
    reader.ReadFile(str(path))
    section, model = reader.IGESModel().GlobalSection(), reader.IGESModel()
    assert (section.UnitFlag(), section.IGESVersion()) == (2, 11)
    entities = [model.Entity(number) for number in range(1, model.NbEntities() + 1)]
    found = [e.Value().ToCString() for e in entities if type(e).__name__ == "IGESBasic_Name"]
    plain = held(name, 1000)
    assert len(found) == 1
    if plain.isascii():
        assert found == [plain]
        assert section.SendName().ToCString() in (plain[:200], "_" + plain[:200])


def named_tetrahedron(name):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    corners = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    paint = Paint((Material(name, (1, 0, 0)),), np.zeros(4, dtype=int))
    return PaintedMesh(points, corners, {name: np.arange(4)}, paint)


@pytest.mark.parametrize("name", ["a\\", "#a", "beam (5')", '"<&>', "a\u202eb", "😀" * 300])
@pytest.mark.parametrize("extension", ["obj", "glb", "3mf"])
def test_mesh_files_are_read_whatever_the_name(name, extension, tmp_path):
    path = tmp_path / f"name.{extension}"
    write_mesh(path, named_tetrahedron(name))
    read = read_mesh(path)
    assert len(read.starts) == 5
    words = re.sub(r"^#|\\$", "_", name).replace(" ", "_") if extension == "obj" else name
    assert [each.name for each in read.labels.materials] == [words]
    assert words in (*read.labels.bodies, *read.labels.groups)


def test_names_that_no_format_holds_are_changed_with_a_word(tmp_path):
    names = ["x" * 3000 + "1", "x" * 3000 + "2", "a\x1b[31mb", "plain"]
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1"]
    faces = ["f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
    for name, face in zip(names, faces, strict=True):
        lines += [f"g {name}", face]
    (tmp_path / "names.obj").write_text("\n".join(lines))
    mesh = read_mesh(tmp_path / "names.obj")
    cut = "x" * 999 + "…"
    assert set(mesh.groups) == {cut, "x" * 997 + "… 2", "a [31mb", "plain"}
    assert mesh.labels.groups == (cut, "x" * 997 + "… 2", "a [31mb", "plain")
    assert mesh.notes == (
        "3 names are changed: control characters become spaces, and what is longer than 1000"
        " characters is cut",
    )


def test_many_long_names_stay_distinct():
    names = [f"{'x' * 1000}{number}" for number in range(3000)]
    new = plain_names(names)
    assert len(set(new.values())) == 3000
    assert max(map(len, new.values())) == 1000


def test_iges_says_which_names_it_changes(tmp_path):
    mesh = read_mesh(cube_file(tmp_path, "Böden (字)"))
    (tmp_path / "lattice.yaml").write_text("version: 1\ndegree: [1, 1, 1]\npoints: [2, 2, 2]\n")
    lattice = read_lattice(tmp_path / "lattice.yaml", mesh)
    written = deform(mesh, lattice).write(tmp_path / "out.igs")
    assert written.warnings == (
        "IGES holds ASCII only: 1 name is written with other characters ('Böden (字)' as"
        " 'Boden (?)')",
    )
    assert deform(mesh, lattice).write(tmp_path / "out.step").warnings == ()


def cube_file(folder, name):
    points = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    quads = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"]
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    path = folder / "cube.obj"
    path.write_text("\n".join([*lines, f"o {name}", *(f"f {quad}" for quad in quads)]), "utf-8")
    return path
