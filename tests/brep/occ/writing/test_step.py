"""STEP files written and read again: every bit, and every fault that reading must not repair."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.extract import extract
from ffdcli.brep.occ.reading.read import record_of
from ffdcli.brep.occ.reading.step import read_step
from ffdcli.brep.occ.writing import step as write_module
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import FileError, KernelError
from ffdcli.units import UNITS
from support import brep_models as models
from support.places import TESTS

MAPS = [None, models.bumpy, models.projective]


def shifted(points):
    """A map whose poles have every bit in use, far from the origin."""
    return models.bumpy(points) / 3 + [1e6 + 0.1, -np.pi, 1e-4 / 7]


@pytest.fixture
def round_trip(tmp_path):
    def run(brep, **options):
        path = tmp_path / "model.step"
        shape = build_shape(brep)
        write_cad(shape, path, **options)
        return extract(shape), read_step(path)

    return run


def batches_equal(before, after):
    assert len(before) == len(after)
    for old, new in zip(before, after, strict=True):
        for name in vars(old):
            assert np.array_equal(getattr(old, name), getattr(new, name)), name


@pytest.mark.parametrize("mapping", [models.bumpy, shifted])
@pytest.mark.parametrize(
    "model",
    [models.cube, models.cube_with_cavity, models.plate_with_hole, models.split_cube],
)
def test_every_bit_comes_back(model, mapping, round_trip):
    before, model_read = round_trip(model(mapping))
    after = record_of(model_read)
    verdict = kernel_check(model_read.shape)
    assert (verdict.valid, verdict.closed) == (True, True), verdict.faults
    batches_equal(before.curves, after.curves)
    batches_equal(before.surfaces, after.surfaces)
    batches_equal(before.pcurves, after.pcurves)
    for name in [
        "points",
        "edges",
        "edge_range",
        "face_surface",
        "face_reversed",
        "face_loops",
        "loop_coedges",
        "coedge_edge",
        "coedge_forward",
        "face_shell",
        "shell_closed",
        "shell_solid",
    ]:
        assert np.array_equal(getattr(before, name), getattr(after, name)), name


def test_rational_surfaces_come_back_to_rounding(round_trip):
    before, model_read = round_trip(models.cube(models.projective))
    after = extract(model_read.shape)
    assert kernel_check(model_read.shape).valid
    for old, new in zip(before.surfaces, after.surfaces, strict=True):
        assert old.poles.shape[-1] == 4
        assert np.array_equal(old.poles, new.poles)


def test_planes_come_back_with_pcurves_in_their_own_frame(round_trip):
    brep = models.plate_with_hole()
    _, model_read = round_trip(brep)
    after = extract(model_read.shape)
    assert np.array_equal(after.planes.origin, brep.planes.origin)
    assert np.array_equal(after.planes.x_axis, brep.planes.x_axis)
    assert np.array_equal(after.planes.y_axis, brep.planes.y_axis)
    (pcurves,) = after.pcurves
    assert sorted(pcurves.coedges.tolist()) == list(range(len(brep.coedge_edge)))
    np.testing.assert_allclose(pcurves.poles, brep.pcurves[pcurves.coedges], atol=1e-15)


@pytest.mark.parametrize("mapping", MAPS)
def test_a_flipped_face_stays_flipped(mapping, round_trip):
    _, model_read = round_trip(models.flip_face(models.cube(mapping), 2))
    after = extract(model_read.shape)
    assert after.face_reversed.tolist() == [True, False, False, False, True, False]
    assert not kernel_check(model_read.shape).valid


@pytest.mark.parametrize("mapping", MAPS)
def test_an_inside_out_solid_stays_so(mapping, round_trip):
    brep = models.cube(mapping)
    _, model_read = round_trip(models.turn_inside_out(brep))
    after = extract(model_read.shape)
    assert after.solid_count == 1
    assert (after.face_reversed == ~brep.face_reversed).all()


@pytest.mark.parametrize("mapping", MAPS)
def test_a_reversed_solid_is_told_from_its_faces(mapping, tmp_path):
    brep = models.cube(mapping)
    shape = build_shape(brep).Reversed()
    assert (extract(shape).face_reversed == ~brep.face_reversed).all()
    write_cad(shape, tmp_path / "reversed.step")
    after = extract(read_step(tmp_path / "reversed.step").shape)
    assert (after.face_reversed == ~brep.face_reversed).all()


@pytest.mark.parametrize("mapping", MAPS)
def test_a_missing_face_leaves_a_solid_with_an_open_shell(mapping, round_trip):
    _, model_read = round_trip(models.without_last_face(models.cube(mapping)))
    after = extract(model_read.shape)
    assert (after.face_count, after.solid_count) == (5, 1)
    assert after.shell_closed.tolist() == [False]
    assert np.bincount(after.coedge_edge).tolist().count(1) == 4


@pytest.mark.parametrize("mapping", MAPS)
def test_a_doubled_face_stays_doubled(mapping, round_trip):
    brep = models.cube(mapping)
    last = slice(brep.loop_coedges[-2], brep.loop_coedges[-1])
    doubled = replace(
        brep,
        face_surface=np.r_[brep.face_surface, brep.face_surface[-1]],
        face_reversed=np.r_[brep.face_reversed, brep.face_reversed[-1]],
        face_loops=np.r_[brep.face_loops, brep.face_loops[-1] + 1],
        loop_coedges=np.r_[brep.loop_coedges, brep.loop_coedges[-1] + 4],
        coedge_edge=np.r_[brep.coedge_edge, brep.coedge_edge[last]],
        coedge_forward=np.r_[brep.coedge_forward, brep.coedge_forward[last]],
        pcurves=np.concatenate([brep.pcurves, brep.pcurves[last]]),
        face_shell=np.zeros(7, int),
    )
    _, model_read = round_trip(doubled)
    after = extract(model_read.shape)
    assert after.face_count == 7
    assert np.bincount(after.coedge_edge).tolist().count(3) == 4


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_numbers_are_written_as_they_are_in_any_unit(unit, round_trip, tmp_path):
    before, model_read = round_trip(models.cube(shifted), unit=unit.name)
    assert model_read.unit == unit.name
    after = extract(model_read.shape)
    assert np.array_equal(before.points, after.points)
    assert np.array_equal(before.surfaces[0].poles, after.surfaces[0].poles)
    text = (tmp_path / "model.step").read_text().replace("\n", "")
    assert f"{before.points[0, 0]:.16E}" in text
    # The writer spells SI units in halves and names the others.
    named = {"mm": ".MILLI.,.METRE.", "cm": ".CENTI.,.METRE.", "m": "SI_UNIT($,.METRE.)"}
    assert named.get(unit.name, "METRE" if "metre" in unit.step else unit.step.upper()) in text


def test_settings_are_put_back(tmp_path):
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_Controller

    STEPControl_Controller.Init_s()
    names = ("write.step.unit", "xstep.cascade.unit", "write.step.schema", "write.precision.mode")
    before = [Interface_Static.CVal_s(name) for name in names]
    write_cad(build_shape(models.cube()), tmp_path / "a.step", unit="inch", schema="ap242")
    assert [Interface_Static.CVal_s(name) for name in names] == before


@pytest.mark.parametrize(
    ("schema", "said"),
    [("ap203", "CONFIG_CONTROL_DESIGN"), ("ap214", "AUTOMOTIVE_DESIGN"), ("ap242", "AP242_")],
)
def test_the_header_says_schema_names_and_program(schema, said, tmp_path):
    path = tmp_path / "part.step"
    header = FileHeader("It's a cube", "Zoë", "R & D \\ 日本")
    write_cad(
        build_shape(models.cube()), path, schema=schema, labels=ShapeLabels("Würfel"), header=header
    )
    text = path.read_bytes().decode("ascii").replace("\n", "")
    assert said in text
    assert "FILE_NAME('part.step','" in text
    assert "'It''s a cube'" in text
    assert "'Zo\\X2\\00EB\\X0\\'" in text
    assert "R & D \\X2\\005C\\X0\\ \\X2\\65E5672C\\X0\\" in text
    assert "PRODUCT(  'W\\X2\\00FC\\X0\\rfel'" in text or "PRODUCT('W\\X2\\00FC\\X0\\rfel'" in text
    assert "'ffdcli " in text


def test_the_largest_tolerance_is_the_file_s(round_trip):
    brep = models.cube(models.bumpy)
    poles = brep.curves[0].poles.copy()
    poles[5, 1:3] += 1e-5
    tolerance = brep.edge_tolerance.copy()
    tolerance[5] = 2e-5
    off = replace(
        brep,
        curves=(replace(brep.curves[0], poles=poles),),
        edge_tolerance=tolerance,
        vertex_tolerance=np.full(8, 2e-5),
    )
    before, model_read = round_trip(off)
    assert sorted(set(before.edge_tolerance)) == [1e-7, 2e-5]
    assert set(extract(model_read.shape).edge_tolerance) == {2e-5}
    assert kernel_check(model_read.shape).valid


def test_the_same_shape_gives_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    brep = models.cube_with_cavity(models.bumpy)
    contents = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "part.step"
        write_cad(build_shape(brep), path)
        write_cad(build_shape(models.cube()), tmp_path / "other.step")
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]
    assert b"'2023-11-14T22:13:20+00:00'" in contents[0]


SCRIPT = """
import sys
sys.path.insert(0, sys.argv[1])
from support import brep_models as models
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.step import read_step
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import FileError

shape = build_shape(models.cube_with_cavity(models.bumpy))
write_cad(shape, sys.argv[2])
kernel_check(read_step(sys.argv[2]).shape)
open(sys.argv[3], "w").write("ISO-10303-21;\\nno")
try:
    read_step(sys.argv[3])
except FileError:
    print("ours")
"""


def test_the_kernel_is_silent_and_another_process_writes_the_same(tmp_path):
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    path, bad = tmp_path / "part.step", tmp_path / "bad.step"
    contents = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, TESTS, path, bad],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.stdout, done.stderr, done.returncode) == ("ours\n", "", 0)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]


def test_printers_of_others_come_back(tmp_path):
    from OCP.Message import Message

    before = Message.DefaultMessenger_s().Printers().Size()
    write_cad(build_shape(models.cube()), tmp_path / "a.step")
    assert Message.DefaultMessenger_s().Printers().Size() == before


@pytest.mark.parametrize("failure", [KernelError("no"), KeyboardInterrupt()])
def test_an_existing_file_survives_a_failure(failure, tmp_path, monkeypatch):
    path = tmp_path / "part.step"
    path.write_text("precious")

    def fail(*_):
        raise failure

    monkeypatch.setattr(write_module, "_set_header", fail)
    with pytest.raises(type(failure)):
        write_cad(build_shape(models.cube()), path)
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["part.step"]


def test_a_full_disk_is_a_plain_error(tmp_path, monkeypatch):
    path = tmp_path / "part.step"

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(write_module, "_step_bytes", full)
    with pytest.raises(FileError, match="no space left on device"):
        write_cad(build_shape(models.cube()), path)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_replaced_through_a_link_and_keeps_its_mode(tmp_path):
    target, link = tmp_path / "real.step", tmp_path / "link.step"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    size = write_cad(build_shape(models.cube()), link)
    assert link.is_symlink()
    assert target.stat().st_size == size
    assert target.stat().st_mode & 0o777 == 0o640


def test_bad_targets_and_options(tmp_path):
    shape = build_shape(models.cube())
    with pytest.raises(FileError, match="folder for this file does not exist"):
        write_cad(shape, tmp_path / "none" / "part.step")
    folder = tmp_path / "folder.step"
    folder.mkdir()
    with pytest.raises(FileError, match="this is a folder"):
        write_cad(shape, folder)
    with pytest.raises(KernelError, match="'furlong'"):
        write_cad(shape, tmp_path / "part.step", unit="furlong")
    with pytest.raises(KernelError, match="'ap999'"):
        write_cad(shape, tmp_path / "part.step", schema="ap999")
    assert list(tmp_path.iterdir()) == [folder]


def test_bad_sources(tmp_path):
    good = tmp_path / "good.step"
    write_cad(build_shape(models.cube()), good)
    text = good.read_text()
    bad = tmp_path / "bad.step"
    with pytest.raises(FileError, match="no such file"):
        read_step(bad)
    with pytest.raises(FileError, match="this is a folder"):
        read_step(tmp_path)
    for content in ("", "garbage", text[: len(text) // 2]):
        bad.write_text(content)
        with pytest.raises(FileError, match="not a STEP file"):
            read_step(bad)
    bad.write_text(text[: text.index("DATA;")] + "DATA;\nENDSEC;\nEND-ISO-10303-21;\n")
    with pytest.raises(FileError, match="no shapes"):
        read_step(bad)
    bad.write_text(text.replace(".MILLI.,.METRE.", ".PICO.,.METRE."))
    with pytest.raises(FileError, match="unit of length"):
        read_step(bad)


def test_a_cylinder_is_refused_by_name():
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

    with pytest.raises(KernelError, match=r"face \d+ lies on .*: CylindricalSurface"):
        extract(BRepPrimAPI_MakeCylinder(1.0, 2.0).Shape())


def test_surfaces_whose_knots_go_on_beyond_their_domain_are_read_as_far_as_it():
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    poles, knots = TColgp_Array2OfPnt(1, 4, 1, 4), TColStd_Array1OfReal(1, 7)
    for i in range(1, 5):
        for j in range(1, 5):
            poles.SetValue(i, j, gp_Pnt(i, j, 0.1 * i * j * j))
    for i in range(1, 8):
        knots.SetValue(i, float(i))
    once = TColStd_Array1OfInteger(1, 7)
    once.Init(1)
    surface = Geom_BSplineSurface(poles, knots, knots, once, once, 2, 2)
    found = extract(BRepBuilderAPI_MakeFace(surface, 1e-7).Shape())
    (batch,) = found.surfaces
    assert batch.u_mults.tolist() == batch.v_mults.tolist() == [3, 1, 3]
    assert batch.u_knots.tolist() == [[3.0, 4.0, 5.0]]
    np.testing.assert_allclose(batch.poles[0, 0, 0], surface.Value(3.0, 3.0).Coord(), atol=1e-14)


def test_a_moved_box_of_another_program_is_read():
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Trsf, gp_Vec
    from OCP.TopLoc import TopLoc_Location

    move = gp_Trsf()
    move.SetTranslation(gp_Vec(10.0, 20.0, 30.0))
    found = extract(BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape().Moved(TopLoc_Location(move)))
    assert found.points.min(axis=0).tolist() == [10.0, 20.0, 30.0]
    assert found.points.max(axis=0).tolist() == [11.0, 22.0, 33.0]
    assert (len(found.points), len(found.edges), found.face_count) == (8, 12, 6)
    assert np.bincount(found.coedge_edge).tolist() == [2] * 12
    # Every plane's pcurves lead back to the points of its edges.
    starts = found.points[found.edges[found.coedge_edge, 0]]
    (pcurves,) = found.pcurves
    face = np.repeat(np.arange(6), 4)[pcurves.coedges]
    image = (
        found.planes.origin[face]
        + pcurves.poles[:, 0, :1] * found.planes.x_axis[face]
        + pcurves.poles[:, 0, 1:] * found.planes.y_axis[face]
    )
    np.testing.assert_allclose(image, starts[pcurves.coedges], atol=1e-13)
