"""STEP files written directly: what OpenCascade reads of them, healing off, is what it reads of its
own files, bit for bit.
"""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.brep.evaluate.integrate import volume_of_brep
from ffdcli.brep.labels import BodyLabels, ShapeLabels, label_shape
from ffdcli.brep.occ.formats import SCHEMAS
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.record import Brep
from ffdcli.brep.step import write
from ffdcli.brep.step.write import write_step
from ffdcli.errors import KernelError
from ffdcli.units import UNIT_NAMES
from support import brep_models as models
from support.places import SAMPLES
from support.step_files import differences, document, write_both

MODELS = {
    "planes": models.cube(),
    "splines": models.cube(models.bumpy),
    "rational": models.cube(models.projective),
    "cavity": models.cube_with_cavity(models.bumpy),
    "hole": models.plate_with_hole(models.bumpy),
    "lines with a hole": models.plate_with_hole(),
    "shared surface": models.split_cube(models.bumpy),
    "two bounds": models.bridged_plate(),
    "seam": models.tube(),
    "inside out": models.turn_inside_out(models.cube(models.bumpy)),
    "flipped face": models.flip_face(models.cube(models.projective), 2),
    "assembly": models.grid_of_cubes(3, models.bumpy, 4),
    "open": replace(
        models.without_last_face(models.cube()),
        shell_closed=np.array([False]),
        shell_solid=np.array([-1]),
    ),
}


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("name", MODELS)
def test_the_kernel_reads_what_it_reads_of_its_own_file(name, schema, tmp_path):
    path = write_both(MODELS[name], tmp_path, schema=schema)
    assert differences(tmp_path) == []
    assert path.stat().st_size < 0.6 * (tmp_path / "kernel.step").stat().st_size


@pytest.mark.parametrize("name", ["lines with a hole", "rational", "cavity"])
@pytest.mark.parametrize("how", [{"pcurves": False}, {"digits": 9}, {"digits": 13}])
def test_fewer_curves_and_digits_are_read_alike_too(name, how, tmp_path):
    write_both(MODELS[name], tmp_path, **how)
    assert differences(tmp_path) == []


@pytest.mark.parametrize("unit", UNIT_NAMES)
def test_units_are_read_alike(unit, tmp_path):
    labels = models.labelled(1)
    path = write_both(MODELS["rational"], tmp_path, labels, unit=unit)
    assert differences(tmp_path) == []
    assert document(path) == document(tmp_path / "kernel.step")


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize(("name", "bodies"), [("splines", 1), ("assembly", 3), ("open", 1)])
def test_names_colours_layers_and_properties_are_read_alike(name, bodies, schema, tmp_path):
    brep = MODELS[name]
    labels = models.labelled(bodies, brep.face_count // bodies)
    odd = replace(labels.bodies[0], name="it's (5') é字😀\n, ;#1=", faces=("ab'",) * 5 + ("",))
    if name != "open":
        labels = replace(labels, bodies=(odd, *labels.bodies[1:]))
    else:
        labels = replace(labels, bodies=(replace(labels.bodies[0], mass=None),))
    path = write_both(brep, tmp_path, labels, schema=schema)
    found = document(path)
    assert found == document(tmp_path / "kernel.step")
    assert ("colour" in repr(found)) == (schema != "ap203")


def test_a_body_of_one_material_is_on_its_layer(tmp_path):
    labels = models.labelled(1)
    whole = replace(labels.bodies[0], materials=(1,) * 6)
    path = write_both(MODELS["splines"], tmp_path, replace(labels, bodies=(whole,)))
    assert document(path) == document(tmp_path / "kernel.step")


@pytest.mark.parametrize("schema", SCHEMAS)
def test_the_same_bytes_whatever_is_printed_at_once(schema, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    labels = models.labelled(3)
    path, contents = tmp_path / "a.step", []
    for values in (1, 17, 200_000):
        write_step(MODELS["assembly"], path, labels=labels, schema=schema, values=values)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1] == contents[2]


def test_header_texts_are_written(tmp_path):
    header = FileHeader("what's this", "Ann O'Nym", "Firm", "Boss")
    path = tmp_path / "a.step"
    labels = ShapeLabels("a", bodies=(BodyLabels("a"),))
    write_step(MODELS["planes"], path, labels=labels, schema="ap203", header=header)
    text = path.read_text()
    assert "FILE_DESCRIPTION(('what''s this'),'2;1');" in text
    assert "('Ann O''Nym'),('Firm')" in text
    assert "PERSON('Ann O''Nym','Ann O''Nym'" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda poles: np.where(poles == poles, np.nan, poles), "not finite"),
        (lambda poles: -poles, "weight is not positive"),
    ],
)
def test_numbers_that_no_surface_can_have_leave_the_old_file(change, message, tmp_path):
    brep = MODELS["rational"]
    surfaces = tuple(replace(batch, poles=change(batch.poles)) for batch in brep.surfaces)
    (tmp_path / "a.step").write_text("old")
    with pytest.raises(KernelError, match=message):
        write_step(
            replace(brep, surfaces=surfaces),
            tmp_path / "a.step",
            labels=label_shape(brep, "a", None),
        )
    assert (tmp_path / "a.step").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_disk_that_holds_other_bytes_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "a.step").write_text("old")
    checked = zlib.crc32
    # The file is read again after its last line was written.
    monkeypatch.setattr(
        write.zlib, "crc32", lambda data, start: checked(data.replace(b"#7=", b"#8=", 1), start)
        if data.startswith(b"ISO") and len(data) > 1000 else checked(data, start)
    )  # fmt: skip
    with pytest.raises(KernelError, match="is not what was written"):
        write_step(MODELS["planes"], tmp_path / "a.step", labels=models.labelled(1))
    assert (tmp_path / "a.step").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def random_model(seed: int) -> Brep:
    """A model deformed by a random cubic map, polynomial or rational, at a random place."""
    rng = np.random.default_rng(seed)
    scale, move = 10.0 ** rng.integers(-3, 4), rng.normal(0, 10, 3)
    linear = np.eye(3) + rng.normal(0, 0.1, (3, 3))
    bend, weigh = rng.normal(0, 0.04, (3, 3)), rng.normal(0, 0.1, 3)

    def mapping(points):
        image = scale * (points @ linear.T + (points**2 * points[..., [1, 2, 0]]) @ bend.T + move)
        if seed % 2:
            return image
        weight = 1.5 + points @ weigh
        return np.concatenate([image * weight[..., None], weight[..., None]], axis=-1)

    kinds = (
        models.cube,
        models.cube_with_cavity,
        models.plate_with_hole,
        models.split_cube,
        lambda map_: models.grid_of_cubes(2, map_, 4 + seed % 3),
    )
    return kinds[seed % len(kinds)](mapping)


def same_when_read(seed, folder):
    how = {"schema": SCHEMAS[seed % 3], "digits": (17, 17, 17, 11)[seed % 4]}
    brep = random_model(seed)
    write_both(
        brep, folder, models.labelled(brep.solid_count, brep.face_count // brep.solid_count), **how
    )
    assert differences(folder) == []
    assert document(folder / "direct.step") == document(folder / "kernel.step")


@pytest.mark.parametrize("seed", range(5))
def test_random_models_are_read_alike(seed, tmp_path):
    same_when_read(seed, tmp_path)


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(5, 205))
def test_many_random_models_are_read_alike(seed, tmp_path):
    same_when_read(seed, tmp_path)


NAMES = ["bracket.obj", "handle.obj", "bottle.obj", "creature.ply"]


@pytest.mark.parametrize(
    ("name", "schema"),
    [
        ("bracket.obj", "ap214"),
        *(
            pytest.param(name, schema, marks=pytest.mark.sweep)
            for name in NAMES
            for schema in SCHEMAS
        ),
    ],
)
def test_samples_are_read_alike(name, schema, tmp_path):
    mesh = read_mesh(SAMPLES / name)
    result = deform(mesh, read_lattice(SAMPLES / f"{name.partition('.')[0]}.yaml", mesh))
    labels = label_shape(result.brep, "part", result.origin.faces, result.masses)
    path = write_both(result.brep, tmp_path, labels, schema=schema)
    assert differences(tmp_path) == []
    assert document(path) == document(tmp_path / "kernel.step")


def test_another_kernel_reads_the_file(tmp_path):
    pykentron = pytest.importorskip("pykentron")
    brep = MODELS["hole"]
    path = write_both(brep, tmp_path)
    shape = pykentron.importers.importStep(str(path)).val()
    assert shape.isValid()
    assert len(shape.Faces()) == brep.face_count
    assert shape.Volume() == pytest.approx(float(volume_of_brep(brep)[1][0]), rel=1e-6)
