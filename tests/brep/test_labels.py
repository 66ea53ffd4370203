"""Names, colours, layers, assemblies and mass properties, read back from files."""

import os
import pickle
import re
import subprocess
import sys

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.labels import BodyLabels, ShapeLabels, label_faces, label_shape, paint
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.formats import SCHEMAS
from ffdcli.brep.occ.targets import TARGET_NAMES, TARGETS
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import KernelError
from ffdcli.labels import Labels
from ffdcli.units import UNITS
from support import brep_models as models
from support.brep_models import BLUE, MATERIALS, RED, labelled
from support.places import TESTS
from support.plain_files import CORNERS

BOX = f"""mtllib paint.mtl
{CORNERS}\
v 0 1.5 4
v 2 1.5 4
usemtl red
f 4 3 2 1
g front
f 1 2 6 5
f 2 3 7 10 6
g
f 3 4 8 7
f 4 1 5 9 8
f 5 6 10 9
usemtl blue
f 9 10 7 8
"""
LATTICE = "degree: [2, 2, 2]\npoints: [4, 4, 4]\nedits:\n  - {edit}\n"


def entities(path):
    """Number, type and arguments of every simple entity, line breaks taken out."""
    text = re.sub(r"\n *", "", path.read_text())
    found = re.findall(r"#(\d+) = (\w+) ?\((.*?)\);(?=#|ENDSEC)", text)
    return {int(number): (kind, rest.replace(" ", "")) for number, kind, rest in found}


def of_kind(found, kind):
    return {number: rest for number, (name, rest) in found.items() if name == kind}


@pytest.fixture
def boxed(job, tmp_path):
    """Deform the painted box, and write it if a name is given."""

    def run(name=None, text=BOX, patches="merged", edit="twist: {axis: w, angle: 25}", **options):
        (tmp_path / "paint.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0.25 1\n")
        result = deform(*job(LATTICE.format(edit=edit), mesh=text), patches=patches)
        return result.write(tmp_path / name, **options) if name else result

    return run


def test_faces_share_what_all_their_polygons_have():
    labels = Labels(
        ("a", "b"),
        ("g",),
        MATERIALS,
        np.array([0, 0, 1, 1]),
        np.array([0, -1, 0, 0]),
        np.array([1, 1, 1, 0]),
    )
    faces = label_faces(labels, np.array([0, 1, 2, 2, 3, 3]), np.array([0, 0, 1, 1, 1, 2]))
    assert faces.body.tolist() == [0, 1, 1]
    assert faces.group.tolist() == [-1, 0, 0]
    assert faces.material.tolist() == [1, -1, 0]


def test_bodies_are_called_by_object_then_group_then_number():
    brep = models.grid_of_cubes(4)
    parts = np.repeat(np.arange(4), 6)
    faces = Labels(
        ("box",),
        ("lid",),
        (),
        np.where(parts < 2, 0, -1),
        np.where(parts == 2, 0, -1),
        np.full(24, -1),
    )
    labels = label_shape(brep, "whole", faces)
    assert [body.name for body in labels.bodies] == ["box", "box-2", "lid", "whole-4"]
    assert labels.bodies[2].faces == ("lid",) * 6
    assert labels.bodies[3].faces == ()
    assert pickle.loads(pickle.dumps(labels)) == labels
    assert [body.name for body in label_shape(models.cube(), "whole", None).bodies] == ["whole"]


def test_the_commonest_colour_is_the_bodys():
    def painted(*materials):
        return paint(ShapeLabels("x", MATERIALS), BodyLabels("x", materials=materials))

    assert painted(0, 1, 1) == (BLUE, (RED, None, None))
    assert painted(0, 1, -1) == (None, (RED, BLUE, None))
    assert painted(0, 0, 2) == (None, (RED, RED, None))
    assert painted() == (None, ())


@pytest.mark.parametrize("patches", ["merged", "bezier"])
def test_a_plane_is_divided_where_materials_meet(boxed, patches):
    plain = BOX.replace("usemtl blue\n", "")
    divided, whole = boxed(patches=patches), boxed(patches=patches, text=plain)
    if patches == "merged":
        assert (divided.brep.face_count, whole.brep.face_count) == (7, 6)
    faces = divided.origin.faces
    assert sorted(set(faces.material.tolist())) == [0, 1]
    assert (faces.material == 1).sum() == divided.brep.face_count - whole.brep.face_count or (
        patches == "bezier"
    )
    assert divided.masses[0].volume == pytest.approx(whole.masses[0].volume, rel=1e-12)
    # Groups alone divide nothing.
    grouped = BOX.replace("usemtl blue\n", "g other\n")
    assert boxed(patches=patches, text=grouped).brep.face_count == whole.brep.face_count


@pytest.mark.parametrize("schema", ["ap214", "ap242"])
def test_step_says_names_colours_and_layers(boxed, schema, tmp_path):
    result = boxed("out.step", schema=schema, check=False)
    found = entities(tmp_path / "out.step")
    faces = of_kind(found, "ADVANCED_FACE")
    called = [rest.split("'")[1] for rest in faces.values()]
    assert sorted(called) == ["blue", "front", "front", "red", "red", "red", "red"]
    blue = next(number for number, rest in faces.items() if rest.startswith("'blue'"))
    (solid,) = of_kind(found, "MANIFOLD_SOLID_BREP")
    assert found[solid][1].startswith("'mesh',")
    ((style, item),) = of_kind(found, "STYLED_ITEM").items()
    assert item.endswith(f",#{solid}")
    ((_, over),) = of_kind(found, "OVER_RIDING_STYLED_ITEM").items()
    assert over.endswith(f",#{blue},#{style}")
    colours = [rest.split(",")[1:] for rest in of_kind(found, "COLOUR_RGB").values()]
    shown = [tuple(map(float, colour)) for colour in colours]
    assert shown == [pytest.approx(BLUE, abs=1e-6)]
    assert "'red'" in str(of_kind(found, "DRAUGHTING_PRE_DEFINED_COLOUR"))
    layers = of_kind(found, "PRESENTATION_LAYER_ASSIGNMENT").values()
    assert [rest.split("'")[1] for rest in layers] == ["red", "blue"]
    assert result.warnings == ()


def test_a_missing_material_file_is_a_warning(boxed):
    result = boxed("out.step", text=BOX.replace("paint.mtl", "lost.mtl"))
    assert len(result.warnings) == 1
    assert (
        "the colours of the material file lost.mtl are left out: there is no such file"
        in result.warnings[0]
    )


@pytest.mark.parametrize("way", [{"schema": "ap203"}, {}])
def test_formats_without_colours_say_so(boxed, way):
    result = boxed("out.step" if way else "out.brep", **way)
    assert len(result.warnings) == 1
    assert "no place for" in result.warnings[0]


def test_ap203_holds_no_more_than_its_first_edition_knows(boxed, tmp_path):
    boxed("out.step", schema="ap203")
    kinds = {kind for kind, _ in entities(tmp_path / "out.step").values()}
    assert not {kind for kind in kinds if "STYLE" in kind or "LAYER" in kind or "COLOUR" in kind}
    assert "PROPERTY_DEFINITION" not in kinds
    text = (tmp_path / "out.step").read_text()
    # The machine and its user are nobody's business.
    assert "PERSON('unknown','unknown','',$,$,$)" in text


@pytest.mark.parametrize("schema", ["ap214", "ap242"])
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_validation_properties_are_true_in_the_unit_they_state(unit, schema, tmp_path):
    path = tmp_path / "two.step"
    write_cad(
        build_shape(models.grid_of_cubes(2)),
        path,
        unit=unit.name,
        schema=schema,
        labels=labelled(2),
    )
    text = re.sub(r"\n *", "", path.read_text())
    found = entities(path)
    properties = [rest for rest in of_kind(found, "PROPERTY_DEFINITION").values()]
    said = [rest.split("'")[3] for rest in properties if "validationproperty" in rest]
    assert sorted(said) == sorted(["surfacearea", "volume", "centroid"] * 2)
    amounts = []
    for rest in of_kind(found, "MEASURE_REPRESENTATION_ITEM").values():
        amount, power = re.search(r"_MEASURE\((.*?)\),#(\d+)", rest).groups()
        derived = re.search(r"#(\d+)", found[int(power)][1])[1]
        length, exponent = re.search(r"#(\d+),(.*)", found[int(derived)][1]).groups()
        # OpenCascade states them in millimetres, whatever the unit of the file.
        assert f"#{length} = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )" in text
        amounts.append(float(amount) / unit.millimetres ** float(exponent))
    assert sorted(amounts) == pytest.approx([1.5, 2.5, 7.25, 7.25], rel=1e-12)
    centres = [r for r in of_kind(found, "CARTESIAN_POINT").values() if "centrepoint" in r]
    assert len(centres) == 2
    for rest in centres:
        assert [float(x) for x in rest.split("(")[1].strip(")").split(",")] == [1, 2, 3]


def test_validation_properties_are_those_of_the_solid(boxed, tmp_path):
    result = boxed("out.step", edit="transform: {at: [':', ':', ':'], scale: [2, 1, 1]}")
    (mass,) = result.masses
    assert (mass.volume, mass.area) == pytest.approx((48, 2 * (4 * 3 + 4 * 4 + 3 * 4)), rel=1e-12)
    assert mass.centroid == pytest.approx((1, 1.5, 2), abs=1e-12)
    text = re.sub(r"\n *", "", (tmp_path / "out.step").read_text())
    assert float(re.search(r"VOLUME_MEASURE\((.*?)\)", text)[1]) == mass.volume


SCRIPT = """
import hashlib, sys
sys.path.insert(0, sys.argv[1])
from support import brep_models as models
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.formats import SCHEMAS
from ffdcli.brep.occ.writing.write import write_cad

for schema in SCHEMAS:
    for bodies in (1, 7):
        shape = build_shape(models.grid_of_cubes(bodies, models.bumpy))
        for _ in range(2):
            write_cad(shape, sys.argv[2], schema=schema, labels=models.labelled(bodies))
            print(hashlib.sha256(open(sys.argv[2], "rb").read()).hexdigest())
"""


def test_same_input_same_bytes(tmp_path):
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    outputs = []
    for seed in "12":
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(TESTS), str(tmp_path / "out.step")],
            env={**environment, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.stderr, done.returncode) == ("", 0)
        outputs.append(done.stdout.split())
    assert outputs[0] == outputs[1]
    # A second file in the same process is the same too.
    assert outputs[0][::2] == outputs[0][1::2]
    assert len(set(outputs[0])) == 2 * len(SCHEMAS)


def iges_rows(path):
    """Type, colour, short label and properties of every entity, by its directory number."""
    lines = path.read_text().splitlines()
    directory = [line for line in lines if line[72] == "D"]
    parameters = {}
    for line in lines:
        if line[72] == "P":
            number = int(line[64:72])
            parameters[number] = parameters.get(number, "") + line[:64].rstrip()
    rows = {}
    for place, (first, second) in enumerate(zip(directory[::2], directory[1::2], strict=True)):
        number = 2 * place + 1
        kind, colour = int(first[:8]), int(second[16:24])
        rows[number] = (kind, colour, second[56:64].strip(), parameters[number].rstrip(";"))
    return rows


@pytest.mark.parametrize(("mode", "kind"), [("brep", 510), ("faces", 144)])
def test_iges_says_names_and_colours(mode, kind, tmp_path):
    path = tmp_path / "two.igs"
    labels = labelled(2)
    write_cad(
        build_shape(models.grid_of_cubes(2, models.bumpy)), path, iges_mode=mode, labels=labels
    )
    rows = iges_rows(path)
    names = {number: row[3].split("H", 1)[1] for number, row in rows.items() if row[0] == 406}
    called = {}
    for row in rows.values():
        last = row[3].split(",")[-1]
        if last.isdigit() and int(last) in names:
            called.setdefault(row[0], []).append((names[int(last)], row[1]))
    assert sum(map(len, called.values())) == 15
    faces = called.pop(kind)
    assert [name for name, _ in faces] == [name for body in labels.bodies for name in body.faces]
    bodies = [name for group in called.values() for name, _ in group]
    assert sorted(bodies) == ["body 0", "body 1", "whole"]
    for (name, colour), material in zip(
        faces, (m for body in labels.bodies for m in body.materials), strict=True
    ):
        # Red is number 2 of the standard's own colours.
        own = [100.0, 0.0, 0.0] if colour == 2 else rows[-colour][3].split(",")[1:4]
        percent = [float(x) for x in own]
        assert percent == pytest.approx([100 * x for x in MATERIALS[material].colour], abs=1e-4), (
            name
        )


def test_labels_of_another_shape_are_refused(tmp_path):
    with pytest.raises(KernelError, match="labels for 2 bodies"):
        write_cad(build_shape(models.cube()), tmp_path / "x.step", labels=labelled(2))
    with pytest.raises(KernelError, match="more than 6 faces"):
        write_cad(build_shape(models.cube()), tmp_path / "x.step", labels=labelled(1, faces=7))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_targets_decide_what_is_not_given(boxed, target, tmp_path):
    chosen = TARGETS[target]
    result = boxed("out.step", target=target, check=False)
    assert result.report["target"] == {
        "name": target,
        "schema": chosen.schema,
        "pcurves": chosen.pcurves,
    }
    assert (b"PCURVE" in (tmp_path / "out.step").read_bytes()) == chosen.pcurves
    if target == "rhino":
        result = boxed("out.igs", target=target, check=False)
        assert result.report["target"] == {"name": target, "iges_mode": "faces"}
        result = boxed("out.igs", target=target, iges_mode="brep", check=False)
        assert result.report["target"] == {"name": target, "iges_mode": "brep"}
        result = boxed("out.step", target=target, schema="ap242", check=False)
        assert result.report["target"]["schema"] == "ap242"
        with pytest.raises(KernelError, match="'abacus'"):
            result.write(tmp_path / "out.step", target="abacus")


def test_a_receivers_degree_cap_holds_for_reduced_results_alone():
    assert TARGETS["rhino"].cap(None, None) is None
    assert TARGETS["rhino"].cap(1e-3, None) == 11
    assert TARGETS["rhino"].cap(1e-3, 3) == 3
    assert TARGETS["generic"].cap(1e-3, None) is None
