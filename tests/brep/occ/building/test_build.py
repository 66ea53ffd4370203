"""OpenCascade shapes built object by object: validity, geometry, and named faults."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.brep.occ.building.build import as_cadquery, build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.extract import extract
from ffdcli.errors import KernelError
from support import brep_models as models

MAPS = [None, models.bumpy, models.projective]
MODELS = [
    models.cube,
    models.cube_with_cavity,
    models.plate_with_hole,
    models.split_cube,
    models.bridged_plate,
]


def volume(shape):
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-9)
    return properties.Mass()


@pytest.mark.parametrize("mapping", MAPS)
@pytest.mark.parametrize("model", MODELS)
def test_the_shape_is_valid_and_closed_and_holds_the_record(model, mapping):
    brep = model(mapping)
    shape = build_shape(brep)
    verdict = kernel_check(shape)
    assert verdict.valid, verdict.faults
    assert verdict.closed
    assert verdict.faults == ()
    found = extract(shape)
    # Numbers of edges and vertices follow the walk over the faces.
    order = np.argsort(found.coedge_edge[np.unique(found.coedge_edge, return_index=True)[1]])
    edge_of = brep.coedge_edge[np.unique(found.coedge_edge, return_index=True)[1]][order]
    assert (edge_of[found.coedge_edge] == brep.coedge_edge).all()
    assert (found.points[found.edges] == brep.points[brep.edges[edge_of]]).all()
    assert (found.coedge_forward == brep.coedge_forward).all()
    assert (found.face_reversed == brep.face_reversed).all()
    assert (found.face_loops == brep.face_loops).all()
    assert (found.loop_coedges == brep.loop_coedges).all()
    assert (found.shell_solid == brep.shell_solid).all()
    assert (found.face_shell == brep.face_shell).all()
    if mapping is not None:
        (pcurves,) = found.pcurves
        assert (pcurves.poles == brep.pcurves[pcurves.coedges]).all()


def test_volumes():
    # The volume of the image is the integral of det J; derivatives by a complex step.
    nodes, weights = np.polynomial.legendre.leggauss(12)
    nodes, weights = (nodes + 1) / 2, weights / 2
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1)
    step = 1e-20j
    columns = [models.bumpy(grid + step * np.eye(3)[axis]).imag / 1e-20 for axis in range(3)]
    determinant = np.linalg.det(np.stack(columns, axis=-1))
    expected = np.einsum("ijk,i,j,k", determinant, weights, weights, weights)
    assert volume(build_shape(models.cube(models.bumpy))) == pytest.approx(expected, rel=1e-12)
    assert volume(build_shape(models.cube_with_cavity())) == pytest.approx(0.875, rel=1e-12)
    assert volume(build_shape(models.plate_with_hole())) == pytest.approx(0.1875, rel=1e-12)


def test_edges_between_planes_are_lines_and_others_keep_their_parameter():
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_BSplineCurve, Geom_Line
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    def curves(shape):
        explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            yield BRep_Tool.Curve_s(edge, 0.0, 1.0), BRep_Tool.Range_s(edge)
            explorer.Next()

    flat = models.plate_with_hole()
    for curve, (first, last) in curves(build_shape(flat)):
        assert isinstance(curve, Geom_Line)
        assert (first, last) in {(0.0, 1.0), (0.0, 0.25), (0.0, 0.5)}
    # The same plate with its planes as bilinear surfaces, written as a map of degree 1.
    bilinear = models.plate_with_hole(lambda points: points * 2, degree=1)
    shape = build_shape(bilinear)
    assert kernel_check(shape).valid
    for curve, span in curves(shape):
        assert isinstance(curve, Geom_BSplineCurve)
        assert curve.Degree() == 1
        assert span == (0.0, 1.0)


def test_a_mixed_solid_of_planes_and_bilinear_surfaces_is_valid():
    flat, curved = models.cube(), models.cube(lambda points: points, degree=1)
    numbers = np.arange(3)
    (surfaces,), planes = curved.surfaces, flat.planes
    mixed = replace(
        curved,
        surfaces=(
            replace(
                surfaces,
                surfaces=numbers,
                u_knots=surfaces.u_knots[:3],
                v_knots=surfaces.v_knots[:3],
                poles=surfaces.poles[:3],
            ),
        ),
        planes=replace(
            planes,
            surfaces=numbers + 3,
            origin=planes.origin[3:],
            x_axis=planes.x_axis[3:],
            y_axis=planes.y_axis[3:],
        ),
    )
    verdict = kernel_check(build_shape(mixed))
    assert (verdict.valid, verdict.closed) == (True, True)


def test_several_solids_make_a_compound_and_an_open_shell_stays_open():
    from OCP.TopAbs import TopAbs_ShapeEnum

    shape = build_shape(models.grid_of_cubes(3))
    assert shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_COMPOUND
    assert extract(shape).solid_count == 3
    sheet = replace(
        models.without_last_face(models.cube(models.bumpy)),
        shell_solid=np.array([-1]),
        shell_closed=np.array([False]),
    )
    shape = build_shape(sheet)
    assert shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SHELL
    verdict = kernel_check(shape)
    assert (verdict.valid, verdict.closed) == (True, False)


def test_the_kernel_names_faults():
    flipped = kernel_check(build_shape(models.flip_face(models.cube(models.bumpy), 2)))
    assert not flipped.valid
    assert flipped.faults == ("shell 0: BadOrientationOfSubshape",)
    missing = kernel_check(build_shape(models.without_last_face(models.cube(models.bumpy))))
    assert (missing.valid, missing.closed) == (False, False)
    assert missing.faults == ("shell 0: NotClosed",)
    brep = models.cube(models.bumpy)
    poles = brep.curves[0].poles.copy()
    poles[7, 1] += 1e-5
    bent = replace(brep, curves=(replace(brep.curves[0], poles=poles),))
    assert any("InvalidCurveOnSurface" in fault for fault in kernel_check(build_shape(bent)).faults)


def test_a_refusal_says_what_was_asked():
    brep = models.cube(models.projective)
    poles = brep.surfaces[0].poles.copy()
    poles[4, 1, 1, 3] *= -1
    negative = replace(brep, surfaces=(replace(brep.surfaces[0], poles=poles),))
    with pytest.raises(KernelError, match=r"surface 4 \(degrees 3 x 3, 4 x 4 poles\)"):
        build_shape(negative)
    high = models.cube(models.bumpy, degree=26)
    with pytest.raises(KernelError, match=r"edge 0 \(degree 26, 27 poles\): it takes no"):
        build_shape(high)
    poles = models.cube().curves[0].poles.copy()
    poles[3, 1] = poles[3, 0]
    short = replace(models.cube(), curves=(replace(models.cube().curves[0], poles=poles),))
    with pytest.raises(KernelError, match="curve of edge 3 "):
        build_shape(short)


@pytest.mark.parametrize("turned", [False, True])
def test_a_seam_keeps_both_pcurves(turned):
    brep = models.flip_face(models.tube(), 0) if turned else models.tube()
    shape = build_shape(brep)
    verdict = kernel_check(shape)
    assert (verdict.valid, verdict.closed) == (True, False), verdict.faults
    found = extract(shape)
    (pcurves,) = found.pcurves
    assert np.array_equal(found.coedge_forward, brep.coedge_forward)
    assert np.array_equal(pcurves.poles, brep.pcurves[pcurves.coedges])


def test_two_uses_in_one_sense_with_different_pcurves_are_refused():
    brep = models.split_cube(models.bumpy)
    first, second = np.flatnonzero(brep.coedge_edge == brep.coedge_edge[-1])
    forward, pcurves = brep.coedge_forward.copy(), brep.pcurves.copy()
    forward[second] = forward[first]
    pcurves[second] += 0.1
    with pytest.raises(KernelError, match="edge 14 lies on surface 5 2 times"):
        build_shape(replace(brep, coedge_forward=forward, pcurves=pcurves))


def test_cadquery_takes_the_shape():
    solid = as_cadquery(build_shape(models.cube(models.bumpy)))
    assert (type(solid).__name__, solid.isValid(), len(solid.Faces())) == ("Solid", True, 6)
    assert len(as_cadquery(build_shape(models.grid_of_cubes(2))).Solids()) == 2


def test_an_edge_off_its_faces_is_named_before_what_follows_from_it():
    brep = models.cube(models.bumpy)
    (batch,) = brep.curves
    poles = batch.poles.copy()
    poles[3, 1:-1] += 1e-3
    verdict = kernel_check(build_shape(replace(brep, curves=(replace(batch, poles=poles),))))
    assert not verdict.valid
    assert verdict.faults[0].startswith("edge ")
    assert verdict.faults[-1].endswith(": UnorientableShape")
