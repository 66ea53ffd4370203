"""Shapes handed to OpenCascade as its binary stream, against those built object by object."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from ffdcli.brep.occ.building.build import build_shape, shape_of_stream
from ffdcli.brep.occ.building.stream import write_stream
from ffdcli.errors import KernelError
from support import brep_models as models
from support.reference_build import build_shape as build_one_by_one


def binary(shape):
    """All there is to a shape: geometry, tolerances, flags, orientation and order of its parts."""
    from OCP.BinTools import BinTools

    stream = BytesIO()
    BinTools.Write_s(shape, stream)
    return stream.getvalue()


def mixed_tolerances(brep):
    edge = 1e-7 * (1 + np.arange(len(brep.edges)))
    return replace(brep, edge_tolerance=edge, vertex_tolerance=np.full(len(brep.points), 1e-4))


def open_pair():
    """A closed and an open body: a solid and a loose shell in one compound."""
    brep = models.without_last_face(models.grid_of_cubes(2, models.bumpy))
    return replace(brep, shell_closed=np.array([True, False]), shell_solid=np.array([0, -1]))


def several_degrees():
    """Curves and surfaces in several batches, in no order."""
    brep = models.cube(models.bumpy)
    (curves,), (surfaces,) = brep.curves, brep.surfaces
    parts = [np.array([7, 2, 11]), np.array([0, 1, 3, 4, 5, 6, 8, 9, 10])]
    halves = [np.array([5, 1]), np.array([0, 2, 3, 4])]
    return replace(
        brep,
        curves=tuple(
            replace(curves, edges=part, knots=curves.knots[part], poles=curves.poles[part])
            for part in parts
        ),
        surfaces=tuple(
            replace(
                surfaces,
                surfaces=half,
                u_knots=surfaces.u_knots[half],
                v_knots=surfaces.v_knots[half],
                poles=surfaces.poles[half],
            )
            for half in halves
        ),
    )


CASES = {
    "planes": models.cube,
    "curved": lambda: models.cube(models.bumpy),
    "rational": lambda: models.cube(models.projective),
    "cavity": lambda: models.cube_with_cavity(models.bumpy),
    "flat hole": models.plate_with_hole,
    "hole": lambda: models.plate_with_hole(models.projective),
    "bilinear": lambda: models.plate_with_hole(lambda points: points * 2, degree=1),
    "one surface, two faces": lambda: models.split_cube(models.bumpy),
    "slit": lambda: models.bridged_plate(models.bumpy),
    "seam": models.tube,
    "turned seam": lambda: models.flip_face(models.tube(), 0),
    "inside out": lambda: models.turn_inside_out(models.cube_with_cavity(models.bumpy)),
    "several solids": lambda: models.grid_of_cubes(3, models.bumpy),
    "solid and shell": open_pair,
    "batches": several_degrees,
    "tolerances": lambda: mixed_tolerances(models.cube(models.bumpy)),
    "no cut ends": lambda: models.axis_brep(models.UNIT_CUBE * 1e6, models.CUBE_FACES),
}


@pytest.mark.parametrize("case", CASES)
def test_the_stream_gives_the_shape_that_the_builder_gives(case):
    brep = CASES[case]()
    assert binary(build_shape(brep)) == binary(build_one_by_one(brep))


def test_the_order_of_parts_is_the_records():
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS, TopoDS_Iterator

    def parts(shape):
        walk = TopoDS_Iterator(shape)
        while walk.More():
            yield walk.Value()
            walk.Next()

    brep = models.grid_of_cubes(2, models.bumpy)
    # Faces of the two bodies take turns.
    turns = np.arange(12).reshape(2, 6).T.ravel()
    mixed = replace(
        brep,
        face_surface=brep.face_surface[turns],
        face_reversed=brep.face_reversed[turns],
        coedge_edge=brep.coedge_edge.reshape(12, 4)[turns].ravel(),
        coedge_forward=brep.coedge_forward.reshape(12, 4)[turns].ravel(),
        pcurves=brep.pcurves.reshape(12, 4, 2, 2)[turns].reshape(-1, 2, 2),
        face_shell=brep.face_shell[turns],
    )
    (batch,) = brep.surfaces
    found = []
    for solid in parts(build_shape(mixed)):
        (shell,) = parts(solid)
        for face in parts(shell):
            pole = BRep_Tool.Surface_s(TopoDS.Face_s(face)).Pole(1, 1)
            found.append((pole.X(), pole.Y(), pole.Z()))
    faces = np.argsort(mixed.face_shell, kind="stable")
    assert found == [tuple(batch.poles[f, 0, 0]) for f in mixed.face_surface[faces]]


def test_a_real_result_is_the_same_shape(icosphere_result):
    brep = icosphere_result.brep
    assert len({batch.poles.shape for batch in brep.surfaces}) > 3
    assert binary(build_shape(brep)) == binary(build_one_by_one(brep))


@pytest.fixture
def icosphere_result(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    from ffdcli import deform, read_lattice, read_mesh

    (tmp_path / "lattice.yaml").write_text(
        "version: 1\nvolume: nurbs\npoints: [6, 6, 6]\n"
        "edits:\n- bend: {axis: w, toward: u, angle: 40}\n- weight: {at: [2, 3, 3], value: 3}\n"
    )
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.obj")
    mesh = read_mesh(tmp_path / "ball.obj")
    return deform(mesh, read_lattice(tmp_path / "lattice.yaml", mesh), check=False)


def test_lines_and_rational_curves_go_into_one_shape(tmp_path):
    """A lattice with weights on part of a mesh: lines between planes outside it."""
    trimesh = pytest.importorskip("trimesh")
    from ffdcli import deform, read_lattice, read_mesh

    still = trimesh.creation.box([1, 1, 1])
    still.apply_translation([5, 0, 0])
    (trimesh.creation.box([1, 1, 1]) + still).export(tmp_path / "two.stl")
    (tmp_path / "l.yaml").write_text(
        "version: 1\nvolume: nurbs\nbox: {min: [-1, -1, -1], max: [1, 1, 1]}\nedits:\n"
        "  - weight: {at: [2, 2, 2], value: 4}\n  - move: {at: [2, 2, 2], by: [0, 0, 0.2]}\n"
    )
    mesh = read_mesh(tmp_path / "two.stl")
    brep = deform(mesh, read_lattice(tmp_path / "l.yaml", mesh)).brep
    assert {batch.poles.shape[2] for batch in brep.curves} == {3, 4}
    assert binary(build_shape(brep)) == binary(build_one_by_one(brep))


def test_the_stream_is_in_the_kernels_current_format():
    # A newer OpenCascade still reads version 4; then this says that its writer has moved on.
    stream = BytesIO()
    write_stream(models.cube(models.bumpy), stream)
    head, mark, _ = binary(build_shape(models.cube(models.bumpy))).partition(b"Curve2ds")
    assert stream.getvalue().startswith(head + mark)


def test_an_unknown_format_version_is_refused(monkeypatch):
    from OCP import BinTools

    monkeypatch.setattr(BinTools, "BinTools_FormatVersion", object())
    with pytest.raises(KernelError, match="version 4"):
        build_shape(models.cube())


def test_a_damaged_stream_is_an_error():
    stream = BytesIO()
    write_stream(models.cube(models.bumpy), stream)
    with pytest.raises(KernelError, match="OpenCascade"):
        shape_of_stream(BytesIO(stream.getvalue().replace(b"TShapes", b"TShaped")))
    with pytest.raises(KernelError, match="OpenCascade"):
        shape_of_stream(BytesIO(b""))


@pytest.mark.parametrize(
    ("field", "place", "value", "message"),
    [
        ("u_knots", (2, 1), 0.0, "surface 2 .*knots do not rise"),
        ("poles", (3, 1, 1, 2), np.nan, "surface 3 .*not finite"),
    ],
)
def test_what_the_kernel_would_refuse_is_named(field, place, value, message):
    brep = models.cube(models.bumpy)
    (batch,) = brep.surfaces
    changed = getattr(batch, field).copy()
    changed[place] = value
    with pytest.raises(KernelError, match=message):
        build_shape(replace(brep, surfaces=(replace(batch, **{field: changed}),)))
