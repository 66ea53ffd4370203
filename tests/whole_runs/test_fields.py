"""Fields of beams and plates by formula: mesh or part in, STEP out, compared with the formula.

The written faces are sampled, the formula is undone at the samples, and what comes out must lie on
the undeformed model. The fit has no part in this.
"""

import json

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GProp import GProp_GProps
from OCP.TopLoc import TopLoc_Location

from support.commands import ffd
from support.field_files import npz
from support.formulas import Cantilever, EndMoment, Twist, block, distance_to_box
from support.jobs import obj

meshio = pytest.importorskip("meshio")

LOW, HIGH = np.array([0.0, -5.0, -2.0]), np.array([100.0, 5.0, 2.0])
# A mesh of 10,000 nodes.
COUNTS = (50, 20, 10)
FEW = (26, 6, 5)
TOLERANCE = 0.01


def write_inputs(folder, formula, counts=COUNTS):
    """The surface of the mesh, and a result with the field of a formula."""
    nodes, bricks, quads = block(LOW, HIGH, counts)
    used, corners = np.unique(quads, return_inverse=True)
    (folder / "beam.obj").write_text(obj(nodes[used], corners.reshape(-1, 4).tolist()))
    moves = formula.image(nodes) - nodes
    mesh = meshio.Mesh(nodes, [("hexahedron", bricks)], point_data={"displacement": moves})
    mesh.write(folder / "result.vtu")
    return folder / "beam.obj", folder / "result.vtu"


def face_points(path, fineness):
    """Points of all faces of a STEP file: nodes of its triangulation, which lie on them."""
    shape = cq.importers.importStep(str(path)).val()
    BRepMesh_IncrementalMesh(shape.wrapped, fineness, False, 0.1, False)
    points = []
    for face in shape.Faces():
        triangles = BRep_Tool.Triangulation_s(face.wrapped, TopLoc_Location())
        nodes = [triangles.Node(n + 1) for n in range(triangles.NbNodes())]
        points += [(node.X(), node.Y(), node.Z()) for node in nodes]
    assert shape.isValid()
    assert shape.ShapeType() == "Solid"
    return np.array(points), shape


def volume(shape):
    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape.wrapped, found, 1e-9)
    return found.Mass()


def fit(model, field, lattice, *options):
    """Fit a field; the report."""
    run = ffd("fit", model, field, "-o", lattice, *options, "--json", "--quiet")
    report = json.loads(run.stdout)
    assert report["jacobian"]["injective"] == "yes"
    return report


@pytest.mark.parametrize(
    ("formula", "growth"),
    [(Cantilever(100, 12), None), (Twist(100, np.radians(60)), 1)],
    ids=["cantilever", "twisted plate"],
)
def test_a_mesh_with_a_result_becomes_a_solid_within_the_tolerance(tmp_path, formula, growth):
    mesh, field = write_inputs(tmp_path, formula)
    report = fit(mesh, field, tmp_path / "l.yaml", "--tolerance", TOLERANCE)
    assert report["fits"][0]["pairs"] == 10_000
    assert report["fits"][0]["within_tolerance"] == 1
    ffd("deform", mesh, tmp_path / "l.yaml", "-o", tmp_path / "out.step")
    points, shape = face_points(tmp_path / "out.step", 0.002)
    assert len(shape.Faces()) == 6
    assert len(points) > 200
    assert distance_to_box(formula.source(points), LOW, HIGH).max() < TOLERANCE
    if growth is not None:
        # A turn of sections keeps the volume.
        assert abs(volume(shape) / np.prod(HIGH - LOW) - growth) < 1e-4


HOLE, RADIUS = np.array([60.0, 0.0]), 2.5


def distance_to_drilled_plate(points):
    """(n,) distance from the surface of the box with a hole along z, or less."""
    hole = np.abs(np.hypot(*(points[:, :2] - HOLE).T) - RADIUS)
    return np.minimum(hole, distance_to_box(points, LOW, HIGH))


def test_a_cad_part_becomes_one_within_the_tolerance(tmp_path):
    size, centre = HIGH - LOW, (HIGH + LOW) / 2
    plate = cq.Workplane().box(*size).translate(tuple(centre))
    plate = plate.cut(cq.Workplane().circle(RADIUS).extrude(40).translate((*HOLE, -20)))
    cq.exporters.export(plate, str(tmp_path / "plate.step"))
    formula = EndMoment(150)
    _, field = write_inputs(tmp_path, formula)
    part, lattice = tmp_path / "plate.step", tmp_path / "l.yaml"
    report = fit(part, field, lattice, "--tolerance", TOLERANCE / 2)
    assert report["fits"][0]["largest"] < TOLERANCE / 2
    out = tmp_path / "out.step"
    ffd("deform", part, lattice, "-o", out, "--fit-tolerance", TOLERANCE / 2)
    points, shape = face_points(out, 0.02)
    assert len(shape.Faces()) == 7
    found = formula.source(points)
    assert distance_to_drilled_plate(found).max() < TOLERANCE
    # All of the hole is there, and all of the plate round it.
    near = np.abs(np.hypot(*(found[:, :2] - HOLE).T) - RADIUS) < TOLERANCE
    assert np.ptp(found[near], axis=0) == pytest.approx([5, 5, 4], abs=0.05)
    np.testing.assert_allclose([found.min(axis=0), found.max(axis=0)], [LOW, HIGH], atol=TOLERANCE)
    # Sections at the height z keep the length 1 - z / R; the plate is even about z = 0.
    assert volume(shape) == pytest.approx(np.prod(size) - np.pi * RADIUS**2 * size[2], rel=1e-3)


COMPENSATED = Cantilever(100, 3)
MOVED = block(LOW, HIGH, FEW)[0]
MOVES = COMPENSATED.image(MOVED) - MOVED


def compensated_then_deformed(folder, carried):
    """Points of a part deformed by minus the field, written, and deformed by another field."""
    mesh, field = write_inputs(folder, COMPENSATED, FEW)
    fit(mesh, field, folder / "against.yaml", "--tolerance", TOLERANCE, "--scale", -1)
    compensated, final = folder / "compensated.step", folder / "final.step"
    ffd("deform", mesh, folder / "against.yaml", "-o", compensated)
    fit(compensated, carried or field, folder / "with.yaml", "--tolerance", TOLERANCE)
    ffd("deform", compensated, folder / "with.yaml", "-o", final, "--fit-tolerance", TOLERANCE)
    points, shape = face_points(final, 0.05)
    assert len(shape.Faces()) == 6
    return points


def test_a_compensated_part_that_is_deformed_is_the_part_as_it_should_be(tmp_path):
    """Each point of the compensated part is moved by the field of the point that it stands for."""
    carried = tmp_path / "carried.npz"
    carried.write_bytes(npz(points=MOVED - MOVES, displacements=MOVES))
    points = compensated_then_deformed(tmp_path, carried)
    # Two fits of the field, and one of the faces.
    assert distance_to_box(points, LOW, HIGH).max() < 3 * TOLERANCE


@pytest.mark.sweep
def test_where_the_field_stays_in_space_compensation_is_right_to_first_order(tmp_path):
    points = compensated_then_deformed(tmp_path, None)
    steps = np.diff(MOVES.reshape(*FEW, 3), axis=0)
    steepest = np.linalg.norm(steps, axis=-1).max() / (HIGH[0] / (FEW[0] - 1))
    bound = steepest * np.linalg.norm(MOVES, axis=1).max()
    assert distance_to_box(points, LOW, HIGH).max() < bound + 3 * TOLERANCE
