"""Files of parts are compared with the deformed part: right ones pass, each fault fails."""

from dataclasses import dataclass, replace

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_GTransform
from OCP.Geom2d import Geom2d_Line
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_CurveType
from OCP.gp import gp_GTrsf, gp_Vec2d
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.part.sample import sampled
from ffdcli.deformation import Deformation
from ffdcli.verify.part.compare import verify_part
from support.parts import PARTS

SHEAR = np.array([[1.1, 0.3, 0.0], [0.0, 0.9, 0.2], [-0.1, 0.0, 1.2]])


@dataclass(frozen=True)
class Linear:
    """A linear map as a deformation."""

    matrix: np.ndarray
    breaks = ()
    alone = ()
    degree = 1
    rational = False
    needs_fit = False

    def images(self, points):
        """Images (n, 3) of points (n, 3)."""
        return points @ self.matrix.T

    def jacobian(self, points):
        """Derivatives (n, 3, 3)."""
        return np.tile(self.matrix, (len(points), 1, 1))


def mapped(shape, matrix):
    """The shape under a linear map, by OpenCascade: its surfaces become B-splines."""
    by = gp_GTrsf()
    for (row, column), value in np.ndenumerate(matrix):
        by.SetValue(row + 1, column + 1, value)
    return cq.Shape.cast(BRepBuilderAPI_GTransform(shape.wrapped, by, True).Shape())


def copied(shape):
    """A copy whose geometry may be changed in place."""
    return cq.Shape.cast(BRepBuilderAPI_Copy(shape.wrapped).Shape())


def judge(part, file, deformation=None, **options):
    """The verdict on shapes of cadquery, by 1e-5 of the size."""
    size = part.BoundingBox().DiagonalLength
    return verify_part(
        sampled([part.wrapped]),
        sampled([file.wrapped]),
        kernel_check(file.wrapped).valid,
        deformation or Deformation.identity(),
        size,
        1e-5 * size,
        samples=1500,
        **options,
    )


def volume_of(shape):
    """The volume of a fine tessellation; OpenCascade's own may be off by some per cent."""
    points, triangles = shape.tessellate(2e-2, 0.1)
    corners = np.array([point.toTuple() for point in points])[np.array(triangles)]
    return np.linalg.det(corners).sum() / 6


def without_face(shape, face):
    """The solid without one of its faces."""
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    builder.MakeSolid(solid)
    for number, each in enumerate(shape.Faces()):
        if number != face:
            builder.Add(shell, each.wrapped)
    builder.Add(solid, shell)
    return cq.Shape.cast(solid)


@pytest.mark.parametrize("name", PARTS)
def test_the_part_itself_passes(name):
    part = PARTS[name]()
    verdict = judge(part, copied(part))
    assert verdict.passed, verdict.reasons
    assert verdict.max_deviation < 1e-9
    assert verdict.watertight
    assert verdict.volume == pytest.approx(volume_of(part), rel=1e-2)
    assert abs(verdict.volume - verdict.expected_volume) <= verdict.volume_error + 1e-9


@pytest.mark.parametrize("name", ["plate", "frustum", "sphere", "loft", "revolution", "hollow"])
def test_another_parametrisation_of_the_deformed_part_passes(name):
    part = PARTS[name]()
    verdict = judge(part, mapped(part, SHEAR), Linear(SHEAR))
    assert verdict.passed, (verdict.reasons, verdict.undecided)
    assert verdict.expected_volume == pytest.approx(
        np.linalg.det(SHEAR) * volume_of(part), rel=1e-2
    )


@pytest.mark.parametrize("name", ["plate", "sphere", "sweep"])
def test_a_mirrored_part_passes_and_faces_outwards(name):
    mirror = np.diag([1.0, 1.0, -1.0])
    part = PARTS[name]()
    verdict = judge(part, mapped(part, mirror), Linear(mirror))
    assert verdict.passed, verdict.reasons
    assert verdict.expected_volume == pytest.approx(volume_of(part), rel=1e-2)


def test_lines_may_have_other_ranges_in_the_file():
    # IGES readers let the range of each line begin at 0.
    part = PARTS["plate"]()
    shape = sampled([part.wrapped])
    pcurves = list(shape.pcurves)
    for number, pcurve in enumerate(pcurves):
        if pcurve is not None and pcurve.GetType() == GeomAbs_CurveType.GeomAbs_Line:
            low, high = pcurve.FirstParameter(), pcurve.LastParameter()
            line = Geom2d_Line(pcurve.Value(low - 5), pcurve.Line().Direction())
            pcurves[number] = Geom2dAdaptor_Curve(line, 5, 5 + high - low)
    breaks = tuple(np.array([each.FirstParameter(), each.LastParameter()]) for each in pcurves)
    file = replace(shape, pcurves=tuple(pcurves), coedge_breaks=breaks)
    verdict = verify_part(shape, file, True, Deformation.identity(), 10.0, 1e-4, samples=1500)
    assert verdict.passed, verdict.reasons
    assert verdict.max_deviation < 1e-9


def test_shells_beside_solids_pass():
    part = cq.Compound.makeCompound([PARTS["hollow"](), cq.Workplane().sphere(9).val().Shells()[0]])
    verdict = judge(part, copied(part))
    assert verdict.passed, verdict.reasons
    assert verdict.solids == 1


@pytest.mark.parametrize("name", ["plate", "cone", "torus", "offset"])
def test_another_deformation_fails(name):
    part = PARTS[name]()
    other = SHEAR + [[0, 1e-4, 0], [0, 0, 0], [0, 0, 0]]
    verdict = judge(part, mapped(part, other), Linear(SHEAR))
    assert not verdict.passed
    assert verdict.reasons
    assert verdict.max_deviation > verdict.tolerance


def test_another_part_fails():
    verdict = judge(PARTS["cylinder"](), cq.Solid.makeCylinder(3.001, 10))
    assert any("faces of the deformed part are off" in reason for reason in verdict.reasons)
    verdict = judge(PARTS["cylinder"](), PARTS["frustum"]())
    assert verdict.reasons


@pytest.mark.parametrize(("name", "face"), [("loft", 2), ("offset", 0), ("sweep", 0)])
def test_a_moved_pole_fails(name, face):
    part = PARTS[name]()
    file = copied(part)
    surface = BRep_Tool.Surface_s(file.Faces()[face].wrapped, TopLoc_Location())
    size = part.BoundingBox().DiagonalLength
    u, v = (surface.NbUPoles() + 1) // 2, (surface.NbVPoles() + 1) // 2
    pole = surface.Pole(u, v)
    pole.SetX(pole.X() + 1e-4 * size)
    surface.SetPole(u, v, pole)
    verdict = judge(part, file, names=["side"] * 9)
    assert any(f"on face {face + 1} (side)" in reason for reason in verdict.reasons)
    assert 1e-5 * size < verdict.max_deviation < 1e-4 * size


@pytest.mark.parametrize(("name", "face"), [("plate", 3), ("sphere", 0), ("hollow", 6)])
def test_a_missing_face_fails(name, face):
    part = PARTS[name]()
    verdict = judge(part, without_face(part, face))
    assert not verdict.passed
    assert any("faces" in reason for reason in verdict.reasons)


@pytest.mark.parametrize(("name", "face"), [("loft", 1), ("revolution", 0), ("plate", 1)])
def test_a_moved_pcurve_fails(name, face):
    part = PARTS[name]()
    file = copied(part)
    coedges = sampled([file.wrapped])
    size = part.BoundingBox().DiagonalLength
    shape = file.Faces()[face].wrapped
    for edge in cq.Shape.cast(shape).Edges():
        pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, shape, 0.0, 1.0)
        if pcurve is None or BRep_Tool.IsClosed_s(edge.wrapped, shape):
            continue
        _, sides = coedges.on_faces(np.array([face]), np.array([[0.0, 0.0]]))
        step = 1e-4 * size / np.linalg.norm(sides[0], axis=1)
        pcurve.Translate(gp_Vec2d(*step))
        break
    verdict = judge(part, file)
    assert any("pcurve" in reason for reason in verdict.reasons), verdict.reasons


def test_faults_of_sense_fail():
    part = PARTS["hollow"]()
    inverted = cq.Shape.cast(part.wrapped.Reversed())
    verdict = judge(part, inverted)
    assert any("inside out" in reason for reason in verdict.reasons)
    assert any("look to the other side" in reason for reason in verdict.reasons)


def test_a_filled_hole_is_named():
    part = cq.Workplane().box(4, 4, 1).faces(">Z").workplane().hole(1).val()
    verdict = judge(part, cq.Workplane().box(4, 4, 1).val())
    assert "the file holds 6 faces, but the part has 7" in verdict.reasons
    assert any("outside the outlines" in reason for reason in verdict.reasons)
    assert any("the file's volume is 16" in reason for reason in verdict.reasons)
