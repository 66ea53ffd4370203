"""`ffd verify` of deformed CAD parts: what is right passes in every format, each fault fails."""

import json
from dataclasses import replace
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.gp import gp_Vec2d
from OCP.TopoDS import TopoDS

from ffdcli import read_part
from ffdcli.brep.occ.part.document import root_shapes
from ffdcli.brep.occ.part.write import NewPart
from ffdcli.models import read_lattice
from ffdcli.part.deform import deform_part
from support import parts
from support.commands import ffd

BEND = """version: 1
degree: [2, 2, 3]
points: [4, 4, 5]
edits:
  - twist: {axis: w, angle: 25}
  - move: {at: [1, 1, 2], by: [0.4, 0.3, -0.2]}
"""
HALF = """version: 1
degree: [2, 2, 2]
points: [5, 5, 5]
box: {min: [0, -30, -30], max: [30, 30, 30]}
border: c1
edits:
  - move: {at: ["2:", 2, 2], by: [0.3, 0.4, 0.2]}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "bend.yaml").write_text(BEND)
    (tmp_path / "half.yaml").write_text(HALF)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def verified(*arguments, status=0):
    """The JSON of `ffd verify`."""
    return json.loads(ffd("verify", *arguments, "--json", status=status).stdout)


@pytest.mark.parametrize(
    ("name", "read", "written"),
    [
        ("plate", ".step", ".step"),
        ("plate", ".brep", ".igs"),
        ("frustum", ".step", ".igs"),
        ("cone", ".igs", ".step"),
        ("sphere", ".step", ".step"),
        ("torus", ".brep", ".step"),
        ("loft", ".step", ".brep"),
        ("sweep", ".step", ".igs"),
        ("revolution", ".igs", ".igs"),
        ("extrusion", ".step", ".step"),
        ("offset", ".step", ".step"),
        ("hollow", ".brep", ".brep"),
        ("pair", ".step", ".step"),
    ],
)
@pytest.mark.parametrize("lattice", ["bend.yaml", "half.yaml"])
def test_what_deform_writes_passes(folder, name, read, written, lattice):
    part = parts.write_part(name, folder, read).name
    out = f"out{written}"
    made = json.loads(
        ffd("deform", part, lattice, "-o", out, "--report", "r.json", "--json").stdout
    )
    found = verified(out, part, lattice, "--against", "r.json")
    assert (found["passed"], found["valid"], found["watertight"]) == (True, True, True)
    assert found["faces"] == made["faces"]
    assert found["max_deviation"] <= max(made["max_error"], found["tolerance"])
    assert found["tolerance"] == pytest.approx(max(made["max_error"], 1e-9 * read_part(part).size))
    assert found["samples"] > 8_000
    assert found["volume"] == pytest.approx(found["expected_volume"], rel=1e-3)


def test_an_assembly_passes(folder):
    parts.assembly().export("whole.step")
    ffd("deform", "whole.step", "half.yaml", "-o", "out.step", "--report", "r.json")
    found = verified("out.step", "whole.step", "half.yaml", "--against", "r.json")
    assert (found["passed"], found["solids"]) == (True, 4)


def test_polyhedra_are_verified_as_meshes(folder):

    cq.exporters.export(
        cq.Workplane().box(4, 3, 2).faces(">Z").workplane().rect(1, 1).cutThruAll(), "b.step"
    )
    ffd("deform", "b.step", "bend.yaml", "-o", "out.step")
    found = verified("out.step", "b.step", "bend.yaml")
    assert found["passed"]
    assert found["max_deviation"] < 1e-11


@pytest.fixture
def made(folder):
    """The plate, deformed, with a function that writes and judges a variant of it."""
    parts.write_part("plate", folder)
    part = read_part("plate.step")
    deformed = deform_part(part, read_lattice("bend.yaml", part))

    def judge(*, status=3, change=None, **fields):
        new = NewPart(part, SimpleNamespace(**{**vars(deformed), **fields}))
        if change is not None:
            change(new)
        new.write("out.brep", unit="mm", check=False)
        return verified("out.brep", "plate.step", "bend.yaml", status=status)

    return SimpleNamespace(part=part, deformed=deformed, judge=judge)


def test_the_variants_begin_with_a_right_file(made):
    assert made.judge(status=0)["passed"]


def test_a_moved_pole_fails(made):
    random = np.random.default_rng(3)
    kinds = [each.kind for each in made.part.surfaces]
    for face in random.choice(np.flatnonzero(np.array(kinds) != "plane"), 4, replace=False):
        surface = made.deformed.surfaces[face]
        poles = surface.poles.copy()
        middle = tuple(np.array(poles.shape[:2]) // 2)
        step = random.normal(size=3)
        poles[middle] += 1e-4 * made.part.size * step / np.linalg.norm(step)
        surfaces = list(made.deformed.surfaces)
        surfaces[face] = replace(surface, poles=poles)
        found = made.judge(surfaces=tuple(surfaces))
        assert any(f"face {face + 1} " in reason for reason in found["reasons"]), found["reasons"]


def test_a_moved_vertex_fails(made):
    points = made.deformed.points.copy()
    points[5] += 1e-4 * made.part.size
    found = made.judge(points=points)
    assert any("1 vertices are not where" in reason for reason in found["reasons"])


def test_a_moved_pcurve_fails(made):
    def change(new):
        face = next(
            face
            for face in parts_of(root_shapes(new._document)[0], "FACE")
            if BRepAdaptor_Surface(TopoDS.Face_s(face)).GetType().name != "GeomAbs_Plane"
        )
        face = TopoDS.Face_s(face)
        for edge in parts_of(face, "EDGE"):
            edge = TopoDS.Edge_s(edge)
            if not BRep_Tool.IsClosed_s(edge, face):
                BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0).Translate(gp_Vec2d(2e-3, 2e-3))
                return

    found = made.judge(change=change)
    assert any("pcurve" in reason for reason in found["reasons"])


def parts_of(shape, kind):
    """Faces or edges of a shape."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    found = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    while found.More():
        yield found.Current()
        found.Next()


def test_another_part_or_lattice_fails_and_says_what_to_do(folder, made):
    made.judge(status=0)
    other = folder / "other.yaml"
    other.write_text(BEND.replace("angle: 25", "angle: 25.1"))
    result = ffd("verify", "out.brep", "plate.step", other, status=3)
    assert "out.brep: FAILED: largest deviation" in result.stdout
    assert "hint: if OUT was made with --fit-tolerance" in result.stderr
    parts.write_part("torus", folder)
    found = verified("out.brep", "torus.step", "bend.yaml", status=3)
    assert "the file holds 15 faces, but the part has 1" in found["reasons"]
