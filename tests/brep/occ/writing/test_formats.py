"""STEP, IGES as solids and as trimmed surfaces, and BREP: what is written comes back."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ffdcli.brep.evaluate.closedness import edge_faults, unchained_loops
from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.formats import cad_format
from ffdcli.brep.occ.reading.extract import extract
from ffdcli.brep.occ.reading.read import read_cad, record_of
from ffdcli.brep.occ.writing import iges as iges_module
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import FileError, KernelError
from ffdcli.units import UNITS
from support import brep_models as models
from support.commands import ffd
from support.places import TESTS
from support.plain_files import CUBE

# Extension and options of every way to write.
WAYS = {
    "ap203": (".step", {"schema": "ap203"}),
    "ap214": (".stp", {"schema": "ap214"}),
    "ap242": (".step", {"schema": "ap242"}),
    "iges": (".iges", {"iges_mode": "brep"}),
    "faces": (".igs", {"iges_mode": "faces"}),
    "brep": (".brep", {}),
}
# Files hold every bit; what is left is of multiplying by weights and dividing again.
ROUNDING = 4 * np.spacing(1e3)
ALL_WAYS = pytest.mark.parametrize("way", WAYS)
# Ways that keep what is wrong with a model as it is.
SHARING = pytest.mark.parametrize("way", [way for way in WAYS if way != "faces"])


def polynomial(points):
    """A map whose poles have every bit in use, far from the origin."""
    return models.bumpy(points) / 3 + [1e3 + 0.1, -np.pi, 1e-4 / 7]


def rational(points):
    image = models.projective(points)
    image[..., :3] = image[..., :3] / 3 + image[..., 3:] * [1e3 + 0.1, -np.pi, 1e-4 / 7]
    return image


@pytest.fixture
def round_trip(tmp_path):
    def run(brep, way, **options):
        extension, how = WAYS[way]
        path = tmp_path / f"model{extension}"
        shape = build_shape(brep)
        assert write_cad(shape, path, **how, **options) == path.stat().st_size
        return extract(shape), read_cad(path)

    return run


def poles_of(batches):
    """Poles and weights of curves or surfaces, by owner."""
    found = {}
    for batch in batches:
        owners = batch.edges if hasattr(batch, "edges") else batch.surfaces
        for owner, poles in zip(owners.tolist(), batch.poles, strict=True):
            weight = poles[..., 3:] if poles.shape[-1] == 4 else np.ones_like(poles[..., :1])
            found[owner] = np.concatenate([poles[..., :3] / weight, weight], axis=-1)
    return found


def worst(before, after):
    """Largest difference of poles and weights; either may run its first parameter backwards."""
    candidates = [side for poles in after.values() for side in (poles, poles[::-1])]
    return max(
        (
            min(
                np.abs(_normal(other) - _normal(poles)).max()
                for other in candidates
                if other.shape == poles.shape
            )
            for poles in before.values()
        ),
        default=0.0,
    )


def _normal(poles):
    """Only ratios of weights count: of equal ones nothing is written."""
    return np.concatenate([poles[..., :3], poles[..., 3:] / poles[..., 3:].max()], axis=-1)


@ALL_WAYS
@pytest.mark.parametrize("mapping", [None, polynomial, rational])
@pytest.mark.parametrize(
    "model", [models.cube, models.cube_with_cavity, models.plate_with_hole, models.split_cube]
)
def test_every_format_brings_back_what_was_written(model, mapping, way, round_trip):
    before, found = round_trip(model(mapping), way)
    after = record_of(found)
    assert kernel_check(found.shape).valid
    for name in ("face_count", "solid_count"):
        assert getattr(after, name) == getattr(before, name)
    assert (len(after.edges), len(after.points)) == (len(before.edges), len(before.points))
    assert after.shell_closed.all()
    assert len(after.shell_closed) == len(before.shell_closed)
    assert np.array_equal(after.shell_solid, before.shell_solid)
    assert not np.any(edge_faults(after))
    assert not len(unchained_loops(after))
    assert worst(poles_of(before.surfaces), poles_of(after.surfaces)) <= ROUNDING
    assert worst(poles_of(before.curves), poles_of(after.curves)) <= ROUNDING
    assert len(after.planes.surfaces) == len(before.planes.surfaces)
    sort = np.lexsort(before.points.T)
    again = np.lexsort(after.points.T)
    assert np.array_equal(before.points[sort], after.points[again])


@pytest.mark.parametrize("way", ["iges", "brep"])
@pytest.mark.parametrize("mapping", [None, polynomial])
def test_iges_solids_and_brep_keep_the_order_too(mapping, way, round_trip):
    before, found = round_trip(models.plate_with_hole(mapping), way)
    after = record_of(found)
    for name in vars(before):
        if name in ("curves", "surfaces", "pcurves", "planes"):
            continue
        assert np.array_equal(getattr(before, name), getattr(after, name)), name
    for old, new in zip(before.pcurves, after.pcurves, strict=True):
        assert np.array_equal(old.poles, new.poles)


@SHARING
@pytest.mark.parametrize("mapping", [None, polynomial, rational])
def test_faults_stay_as_they_are(mapping, way, round_trip):
    brep = models.cube(mapping)
    before, found = round_trip(models.flip_face(brep, 2), way)
    assert np.array_equal(record_of(found).face_reversed, before.face_reversed)
    assert not kernel_check(found.shape).valid
    _, found = round_trip(models.turn_inside_out(brep), way)
    assert np.array_equal(record_of(found).face_reversed, ~brep.face_reversed)
    _, found = round_trip(models.without_last_face(brep), way)
    after = record_of(found)
    assert (after.face_count, after.solid_count) == (5, 1)
    assert after.shell_closed.tolist() == [False]


@pytest.mark.parametrize("mapping", [None, polynomial, rational])
def test_trimmed_surfaces_show_faults_by_their_edges(mapping, round_trip):
    brep = models.cube(mapping)
    _, found = round_trip(models.flip_face(brep, 2), "faces")
    ending, wrong = edge_faults(record_of(found))
    assert (ending.sum(), wrong.sum()) == (0, 4)
    _, found = round_trip(models.without_last_face(brep), "faces")
    after = record_of(found)
    assert (after.face_count, after.solid_count) == (5, 0)
    assert edge_faults(after)[0].sum() == 4
    assert after.shell_closed.tolist() == [False]


@ALL_WAYS
def test_several_solids_and_a_slit(way, round_trip):
    _, found = round_trip(models.grid_of_cubes(3, polynomial), way)
    after = record_of(found)
    assert (after.solid_count, len(after.edges), after.face_count) == (3, 36, 18)
    assert after.face_shell.tolist() == np.repeat([0, 1, 2], 6).tolist()
    _, found = round_trip(models.bridged_plate(polynomial), way)
    after = record_of(found)
    assert (after.solid_count, len(after.edges), after.face_count) == (1, 25, 10)
    assert kernel_check(found.shape).valid


@pytest.mark.parametrize("way", ["iges", "faces"])
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_iges_says_the_unit_and_scales_nothing(unit, way, round_trip, tmp_path):
    before, found = round_trip(models.cube(polynomial), way, unit=unit.name)
    assert found.unit == unit.name
    after = record_of(found)
    assert np.array_equal(np.unique(before.points, axis=0), np.unique(after.points, axis=0))
    assert worst(poles_of(before.surfaces), poles_of(after.surfaces)) <= ROUNDING
    head = (tmp_path / f"model{WAYS[way][0]}").read_text()[:800]
    flag = unit.iges
    assert f",1.,{flag},{len(unit.kernel)}H{unit.kernel}," in head


def test_brep_states_no_unit(round_trip):
    _, found = round_trip(models.cube(), "brep", unit="inch")
    assert found.unit is None


@pytest.mark.parametrize("way", ["iges", "faces"])
def test_the_iges_header_is_ours_and_its_tolerance_is_true(way, round_trip, tmp_path):
    brep = models.cube(polynomial, tolerance=2.345678912e-6)
    header = FileHeader("Würfel " * 20, "Zoë", "R & D 日本")
    _, found = round_trip(brep, way, labels=ShapeLabels("Würfel"), header=header)
    content = (tmp_path / f"model{WAYS[way][0]}").read_bytes()
    assert content.isascii()
    assert all(len(line) == 80 for line in content.splitlines())
    text = content.decode()
    for said in ("6HWurfel", "3HZoe", "8HR & D ??", "ffdcli ", "Wurfel Wurfel"):
        assert said in text
    assert set(record_of(found).edge_tolerance) == {2.34568e-6}


SCRIPT = """
import sys
sys.path.insert(0, sys.argv[1])
from support import brep_models as models
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.brep.occ.reading.read import read_cad, record_of
from ffdcli.errors import FileError

shape = build_shape(models.plate_with_hole(models.projective))
for mode, path in (("brep", sys.argv[2]), ("faces", sys.argv[3]), ("brep", sys.argv[4])):
    write_cad(shape, path, iges_mode=mode)
    found = read_cad(path)
    record_of(found), kernel_check(found.shape)
    bad = path.replace("good", "bad")
    content = open(path, "rb").read()
    for cut in (0, 10, len(content) // 2, len(content) - 200):
        open(bad, "wb").write(content[:cut])
        try:
            read_cad(bad)
        except FileError:
            print("ours")
"""


def test_the_kernel_is_silent_and_processes_write_the_same(tmp_path):
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    paths = [tmp_path / name for name in ("good.iges", "good.igs", "good.brep")]
    contents = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, TESTS, *paths],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.stdout, done.stderr, done.returncode) == ("ours\n" * 12, "", 0)
        contents.append([path.read_bytes() for path in paths])
    assert contents[0] == contents[1]
    assert b"20231114.221320" in contents[0][0]


@ALL_WAYS
@pytest.mark.parametrize("failure", [KernelError("no"), KeyboardInterrupt()])
def test_an_existing_file_survives_a_failure(failure, way, tmp_path, monkeypatch):
    extension, how = WAYS[way]
    path = tmp_path / f"part{extension}"
    path.write_text("precious")

    def fail(*_):
        raise failure

    for module, name in (
        ("step", "_step_bytes"),
        ("iges", "_iges_bytes"),
        ("brep", "_with_all_digits"),
    ):
        monkeypatch.setattr(f"ffdcli.brep.occ.writing.{module}.{name}", fail)
    with pytest.raises(type(failure)):
        write_cad(build_shape(models.cube()), path, **how)
    assert path.read_text() == "precious"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_other_users_of_the_kernel_find_their_settings(tmp_path):
    from OCP.IGESControl import IGESControl_Reader
    from OCP.Interface import Interface_Static

    path = tmp_path / "part.igs"
    write_cad(build_shape(models.cube(polynomial)), path, unit="inch", iges_mode="faces")
    names = ("xstep.cascade.unit", "read.iges.bspline.continuity", "write.precision.mode")

    def state():
        return [Interface_Static.CVal_s(name) for name in names]

    before = state()

    def points_as_others_read_them():
        reader = IGESControl_Reader()
        reader.ReadFile(str(path))
        reader.TransferRoots()
        return extract(reader.OneShape()).points

    first = points_as_others_read_them()
    read_cad(path)
    assert np.array_equal(points_as_others_read_them(), first)
    assert state() == before
    # They ask for millimetres.
    np.testing.assert_allclose(
        first[:, 0].max(), 25.4 * record_of(read_cad(path)).points[:, 0].max()
    )


def test_bad_targets_options_and_sources(tmp_path):
    shape = build_shape(models.cube())
    with pytest.raises(KernelError, match="'solid'"):
        write_cad(shape, tmp_path / "part.igs", iges_mode="solid")
    with pytest.raises(KernelError, match="'furlong'"):
        write_cad(shape, tmp_path / "part.igs", unit="furlong")
    with pytest.raises(KernelError, match=r"'\.dxf'"):
        write_cad(shape, tmp_path / "part.dxf")
    with pytest.raises(FileError, match="by its extension"):
        read_cad(tmp_path / "part.dxf")
    for name, kind in (("part.igs", "an IGES"), ("part.brep", "a BREP")):
        path = tmp_path / name
        with pytest.raises(FileError, match="no such file"):
            read_cad(path)
        path.write_text("garbage\n")
        with pytest.raises(FileError, match=f"not {kind} file"):
            read_cad(path)
    path = tmp_path / "part.igs"
    write_cad(shape, path)
    path.write_text(path.read_text().replace(",2,2HMM,", ",3,2HXY,"))
    with pytest.raises(FileError, match="unknown unit of length"):
        read_cad(path)
    assert cad_format("a.STEP") == cad_format("b.stp") == "STEP"


def test_a_model_too_large_for_iges_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(iges_module, "_MOST_LINES", 500)
    with pytest.raises(KernelError, match="no more than 500 can be numbered"):
        write_cad(build_shape(models.cube(polynomial)), tmp_path / "part.igs")
    assert list(tmp_path.iterdir()) == []


def test_commands_write_and_take_every_format(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cube.obj").write_text(CUBE)
    Path("lattice.yaml").write_text(
        "version: 1\nunit: cm\nedits:\n  - twist: {axis: w, angle: 30}\n"
    )

    both = ("cube.obj", "lattice.yaml")
    for words in (
        ["a.step", "--schema", "ap203"],
        ["b.stp", "--schema", "ap242"],
        ["c.iges"],
        ["d.igs", "--iges-mode", "faces"],
        ["e.brep"],
    ):
        ffd("deform", *both, "-o", *words)
        verdict = json.loads(ffd("verify", words[0], *both, "--unit", "cm", "--json").stdout)
        assert (verdict["passed"], verdict["watertight"]) == (True, True), verdict
        assert (verdict["solids"], verdict["faces"], verdict["unit"]) == (1, 6, "cm")
        facts = json.loads(ffd("info", words[0], "--json").stdout)
        assert (facts["kind"], facts["closed"], facts["edges"]) == ("cad", True, 12)
        assert facts["unit"] == (None if words[0] == "e.brep" else "cm")
    ffd("deform", *both, "-o", "f.igs", "--schema", "ap203", status=2)
    ffd("deform", *both, "-o", "f.step", "--iges-mode", "faces", status=2)
    ffd("deform", *both, "-o", "f.dxf", status=1)
