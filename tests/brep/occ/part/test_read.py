"""Parts read from CAD files: their records against OpenCascade's own values."""

import cadquery as cq
import numpy as np
import pytest
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder
from OCP.BRepBndLib import BRepBndLib
from OCP.Geom import Geom_Plane
from OCP.gp import gp_Dir, gp_Pnt
from OCP.TopLoc import TopLoc_Location

from ffdcli.brep.occ.part.document import document_of, root_shapes
from ffdcli.brep.occ.part.mesh import _width
from ffdcli.brep.occ.part.read import read_part
from ffdcli.brep.occ.part.walk import number_parts
from ffdcli.errors import FileError
from support import parts

KINDS = {
    "plate": {"plane": 7, "cylinder": 7, "torus": 1},
    "cylinder": {"plane": 2, "cylinder": 1},
    "frustum": {"plane": 2, "cone": 1},
    "cone": {"plane": 1, "cone": 1},
    "sphere": {"sphere": 1},
    "torus": {"torus": 1},
    "loft": {"plane": 2, "b-spline": 5},
    "sweep": {"plane": 2, "b-spline": 1},
    "revolution": {"plane": 2, "revolution": 1},
    "extrusion": {"plane": 2, "extrusion": 1},
    "offset": {"b-spline": 5, "offset": 1},
    "hollow": {"plane": 6, "sphere": 1},
    "nut": {"plane": 8, "cylinder": 1, "cone": 1},
    "pair": {"plane": 8, "cylinder": 1},
}
SHELLS = {"hollow": (1, 2), "pair": (2, 2)}


@pytest.fixture(scope="module", params=list(parts.PARTS))
def name(request):
    return request.param


@pytest.fixture(scope="module", params=[".step", ".brep", ".igs"])
def part(request, name, tmp_path_factory):
    return read_part(parts.write_part(name, tmp_path_factory.mktemp(name), request.param))


def test_faces_of_each_kind_and_their_topology(name, part):
    kinds = [surface.kind for surface in part.surfaces]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == KINDS[name]
    assert (part.solid_count, len(part.shell_closed)) == SHELLS.get(name, (1, 1))
    assert part.shell_closed.all()
    assert part.notes == ()
    # Every edge is used twice, in opposite senses; degenerate ones once.
    uses = np.bincount(part.coedge_edge, np.where(part.coedge_forward, 1, -1), len(part.edges))
    assert not uses[~part.degenerate].any()


def test_pcurves_lie_on_the_edges(part):
    for coedge, edge in enumerate(part.coedge_edge):
        if part.degenerate[edge]:
            continue
        at = np.linspace(*part.edge_range[edge], 9)
        spot = part.pcurves[coedge].points(at)
        surface = part.surfaces[part.face_of_coedge[coedge]]
        off = surface.points(*spot.T) - part.curves[edge].points(at)
        assert np.abs(off).max() <= part.edge_tolerance[edge]


def test_vertices_lie_at_the_ends_of_edges(part):
    for edge in np.flatnonzero(~part.degenerate):
        ends = part.curves[edge].points(part.edge_range[edge])
        off = np.linalg.norm(ends - part.points[part.edges[edge]], axis=1)
        assert (off <= part.vertex_tolerance[part.edges[edge]]).all()


def test_bounds_are_those_of_the_shape(name, part):
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(parts.PARTS[name]().wrapped, box, False, False)
    expected = np.array(box.Get()).reshape(2, 3)
    # OpenCascade adds its precision of 1e-7, and bounds splines less tightly. Pcurves that were
    # fitted, as those of the nut, leave their edges by their tolerance.
    loose = part.edge_tolerance.max() if name == "nut" else 1e-9
    assert (part.bounds[0] > expected[0] - loose).all()
    assert (part.bounds[1] < expected[1] + loose).all()
    np.testing.assert_allclose(part.bounds, expected, atol=1e-2)


def test_a_plane_off_its_edges_is_within_the_bounds(tmp_path):
    box = cq.Workplane().box(4, 4, 4).edges("|Z").fillet(1).val()
    top = max(box.Faces(), key=lambda face: face.Center().z)
    builder = BRep_Builder()
    builder.UpdateFace(
        top.wrapped, Geom_Plane(gp_Pnt(0, 0, 2.003), gp_Dir(0, 0, 1)), TopLoc_Location(), 1e-7
    )
    for edge in top.Edges():
        builder.UpdateEdge(edge.wrapped, 0.004)
    box.exportBrep(str(tmp_path / "loose.brep"))
    part = read_part(tmp_path / "loose.brep")
    np.testing.assert_allclose(part.bounds, [[-2, -2, -2], [2, 2, 2.003]], atol=1e-9)


def test_samples_inside_faces_stay_within_the_bounds(part):
    # Faces reach no further than their own rectangle.
    for surface, rectangle in zip(part.surfaces, part.rectangles, strict=True):
        assert np.isfinite(rectangle).all()
        assert (rectangle[1] > rectangle[0]).all()
        assert np.isfinite(surface.points(*rectangle.mean(axis=0))).all()


def test_the_document_of_an_assembly_is_kept(tmp_path):
    path = tmp_path / "assembly.step"
    parts.assembly().export(str(path))
    part = read_part(path)
    assert part.solid_names == ("base_part", "pin-0", "pin-0", "pin-0")
    assert (part.solid_count, part.face_count, part.unit) == (4, 18, "mm")
    (shape,) = root_shapes(document_of(part.handle))
    assert cq.Shape.cast(shape).Volume() == pytest.approx(parts.assembly().toCompound().Volume())


def test_what_a_file_leaves_out_is_completed(tmp_path):
    # Without pcurves, and without the degenerate edge at the apex.
    path = tmp_path / "cone.step"
    shape = cq.Workplane(parts.PARTS["cone"]())
    cq.exporters.export(shape, str(path), opt={"write_pcurves": False})
    part = read_part(path)
    assert part.notes == ()
    assert part.degenerate.sum() == 1
    assert all(each is not None for each in part.pcurves)


def test_an_open_part_is_named_with_face_and_place(tmp_path):
    path = tmp_path / "open.brep"
    cq.Shell.makeShell(cq.Workplane().box(2, 2, 2).faces("not >Z").vals()).exportBrep(str(path))
    (note,) = read_part(path).notes
    assert note.startswith("the part is open: 4 edges belong to one face only, the first to face ")
    assert "near (" in note


def test_a_turned_face_is_turned_back_and_said(tmp_path):
    path = tmp_path / "box.step"
    cq.exporters.export(cq.Workplane().box(2, 2, 2), str(path))
    lines = path.read_text()
    place = lines.index("ADVANCED_FACE")
    end = lines.index(";", place)
    turned = (
        lines[place:end].replace(".F.)", ".X.)").replace(".T.)", ".F.)").replace(".X.)", ".T.)")
    )
    path.write_text(lines[:place] + turned + lines[end:])
    part = read_part(path)
    assert any("turned" in note or "repaired" in note for note in part.notes)


def test_files_that_hold_no_part_are_refused(tmp_path):
    path = tmp_path / "edges.brep"
    cq.Edge.makeCircle(2).exportBrep(str(path))
    with pytest.raises(FileError, match="the file holds no faces"):
        read_part(path)
    with pytest.raises(FileError, match="no CAD file by its extension"):
        read_part(tmp_path / "part.obj")


def test_curves_outside_of_faces_are_said(tmp_path):
    path = tmp_path / "sketch.brep"
    box, circle = cq.Workplane().box(2, 2, 2).val(), cq.Edge.makeCircle(3)
    cq.Compound.makeCompound([box, circle]).exportBrep(str(path))
    part = read_part(path)
    assert part.notes == ("1 curve lies outside of faces: no lattice moves them",)
    assert (part.face_count, len(part.edges)) == (6, 12)


def test_the_highest_point_may_lie_beside_the_end_of_a_closed_curve(tmp_path):
    part = read_part(parts.write_part("extrusion", tmp_path))
    fine = parts.PARTS["extrusion"]().tessellate(1e-4)[0]
    corners = np.array([point.toTuple() for point in fine])
    assert (part.bounds[0] <= corners.min(axis=0) + 1e-12).all()
    assert (part.bounds[1] >= corners.max(axis=0) - 1e-12).all()
    assert part.bounds[1, 0] > 4 + 1e-3


def test_the_width_of_a_sliver():
    # Readers make such faces, and OpenCascade may fail to divide them into triangles.
    sliver = cq.Face.makePlane(1e-5, 1.8).wrapped
    assert _width(number_parts([sliver]), 0) == pytest.approx(1e-5, rel=1e-4)


def test_edges_that_end_away_from_their_vertices_are_said(tmp_path):
    part = read_part(parts.write_loose_block(tmp_path, 0.003))
    assert part.valid
    (note,) = part.notes
    assert note.startswith("3 edges end away from their vertices")
    assert "by 0.003 " in note
