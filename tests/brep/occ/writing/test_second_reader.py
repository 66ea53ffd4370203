"""STEP files read by a kernel that is not the one that wrote them (pykentron, written in Rust).

It reads in millimetres. It does not see a curve off its surface, calls an open shell a solid, and
leaves out solids with cavities, whoever wrote them; see the tests of these.
"""

import re

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.evaluate.integrate import volume_of_brep
from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.formats import SCHEMAS
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.units import UNITS
from support import brep_models as models

pykentron = pytest.importorskip("pykentron")

CUBE = [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 1) for x in (0, 1)]
QUADS = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
LATTICE = """\
volume: {volume}
degree: [2, 2, 2]
points: [4, 4, 4]
edits:
  - move: {{at: [1, 2, -1], by: [0.1, 0.05, 0.3]}}
  - twist: {{axis: w, angle: 25}}
{more}"""
PAINT = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0.25 1\n"


def triangles(start=0, quads=QUADS):
    return [
        f"f {a + start} {b + start} {c + start}"
        for q in quads
        for a, b, c in (q[:3], (q[0], *q[2:]))
    ]


def read(path):
    return pykentron.importers.importStep(str(path)).val()


@pytest.fixture
def made(job, tmp_path):
    """Deform lines of an OBJ file and write it."""

    def run(lines, name="out.step", volume="bspline", more="", patches="merged", **options):
        (tmp_path / "two.mtl").write_text(PAINT)
        lattice = LATTICE.format(volume=volume, more=more)
        result = deform(*job(lattice, mesh="\n".join([*lines, ""])), patches=patches)
        path = tmp_path / name
        return result.write(path, **options), path

    return run


def agrees(shape, result):
    """Faces, closedness, volume and area are those of the result."""
    solids = shape.Solids()
    assert len(shape.Faces()) == result.brep.face_count
    assert len(solids) == result.brep.solid_count
    for solid, mass in zip(solids, result.masses, strict=True):
        assert solid.isValid()
        assert all(shell.Closed() for shell in solid.Shells())
        assert solid.Volume() == pytest.approx(mass.volume, rel=1e-6)
        assert solid.Area() == pytest.approx(mass.area, rel=1e-6)
        assert solid.Center().toTuple() == pytest.approx(mass.centroid, abs=1e-6)


@pytest.mark.parametrize(("patches", "faces"), [("merged", 6), ("bezier", 24)])
def test_the_cube_of_the_paper(made, patches, faces):
    result, path = made([*CUBE, *triangles()], patches=patches)
    assert result.brep.face_count == faces
    agrees(read(path), result)


def test_rational_faces(made):
    more = "  - weight: {at: [1, 1, -1], value: 3}\n"
    result, path = made([*CUBE, *triangles()], volume="nurbs", more=more)
    assert result.report["rational"]
    agrees(read(path), result)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_an_assembly_of_two_bodies_with_names_and_colours(made, schema):
    shifted = [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 1) for x in (3, 4)]
    lines = ["mtllib two.mtl", "o Lid", *CUBE, "usemtl red", *triangles(), "o Böden"]
    lines += [*shifted, "usemtl blue", "g foot", *triangles(8)]
    result, path = made(lines, schema=schema)
    agrees(read(path), result)
    assembly = pykentron.Assembly.importStep(str(path))
    parts = dict(assembly.traverse())
    assert list(parts) == ["Lid", "Böden", "mesh"]
    colours = [part.color and part.color.toTuple() for part in parts.values()]
    if schema == "ap203":
        assert colours == [None] * 3
        assert result.warnings == ("AP203 has no place for colours: they are left out",)
    else:
        assert colours[0] == pytest.approx((1, 0, 0, 1), abs=1e-6)
        assert colours[1] == pytest.approx((0, 0.25, 1, 1), abs=1e-6)
        assert result.warnings == ()


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_units_are_stated_and_honoured(unit, schema, tmp_path):
    path = tmp_path / "cube.step"
    write_cad(build_shape(models.cube()), path, unit=unit.name, schema=schema)
    box = read(path).BoundingBox()
    sizes = (box.xlen, box.ylen, box.zlen)
    assert sizes == pytest.approx((unit.millimetres,) * 3, rel=1e-6)


def test_files_without_pcurves(made):
    result, path = made([*CUBE, *triangles()], target="rhino")
    assert b"PCURVE" not in path.read_bytes()
    agrees(read(path), result)


def test_an_open_shell(made):
    result, path = made([*CUBE, *triangles(quads=QUADS[:5])])
    assert result.brep.solid_count == 0
    shape = read(path)
    assert len(shape.Faces()) == 5
    # Only the area tells: the reader closes the shell in name.
    closed, _ = made([*CUBE, *triangles()], name="closed.step")
    assert 0 < shape.Area() < closed.masses[0].area


def test_a_cavity_shell_by_shell(tmp_path):
    brep = models.cube_with_cavity(models.bumpy)
    path = tmp_path / "cavity.step"
    write_cad(build_shape(brep), path, labels=ShapeLabels("hollow"))
    # This reader knows no solids with voids: one day it will, and this test can be like the others.
    assert len(read(path).Faces()) == 0
    text = path.read_text()
    solid = re.search(r"(#\d+) = BREP_WITH_VOIDS\('',(#\d+),\((#\d+)\)\);", text)
    void = re.search(rf"{solid[3]} = ORIENTED_CLOSED_SHELL\('',\*,(#\d+),\.F\.\);", text)
    volumes, faces = [], 0
    for shell in (solid[2], void[1]):
        alone = text.replace(solid[0], f"{solid[1]} = MANIFOLD_SOLID_BREP('',{shell});")
        path.write_text(alone)
        shape = read(path)
        faces += len(shape.Faces())
        assert shape.Closed()
        volumes.append(shape.Volume())
    assert faces == 12
    assert volumes[0] - volumes[1] == pytest.approx(volume_of_brep(brep)[1][0], rel=1e-6)


def test_flat_faces_have_the_volume_of_the_cube(tmp_path):
    path = tmp_path / "cube.step"
    write_cad(build_shape(models.cube()), path)
    shape = read(path)
    assert (shape.Volume(), shape.Area()) == pytest.approx((1, 6), rel=1e-12)
    np.testing.assert_allclose(shape.Center().toTuple(), 0.5, atol=1e-12)
