"""Deformed parts as they are written: topology, names and places kept, valid, read by others."""

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from OCP.BOPAlgo import BOPAlgo_Builder
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_CylindricalSurface
from OCP.GProp import GProp_GProps
from OCP.TopoDS import TopoDS
from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_ColorTool, XCAFDoc_ColorType, XCAFDoc_Volume

from ffdcli import deform, read_lattice, read_part
from ffdcli.brep.labels import BodyLabels, ShapeLabels
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.part.document import (
    components_of,
    document_of,
    name_of,
    referred,
    root_shapes,
    roots_of,
)
from ffdcli.brep.occ.part.labels import colours_in
from ffdcli.brep.occ.part.load import load_document
from ffdcli.brep.occ.part.walk import number_parts
from ffdcli.brep.occ.part.write import NewPart
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.brep.record import MassProperties
from ffdcli.errors import CheckError
from ffdcli.labels import Material
from ffdcli.verify.part.file import verify_part_file
from support import parts

pykentron = pytest.importorskip("pykentron")

BENT = """\
version: 1
degree: [3, 3, 3]
points: [5, 4, 6]
edits:
  - twist: {axis: w, angle: 35}
  - taper: {axis: w, factor: 0.7}
"""
# The right half alone, the border smooth.
HALF = """\
version: 1
degree: [3, 3, 3]
points: [6, 4, 4]
box: {{min: [{x}, -20, -20], max: [21, 20, 20]}}
border: {border}
edits:
  - move: {{at: ["3:", ":", ":"], by: [1, 2, 3]}}
"""


def deformed(path, lattice, tmp_path):
    part = read_part(path)
    (tmp_path / "lattice.yaml").write_text(lattice)
    return part, deform(part, read_lattice(tmp_path / "lattice.yaml", part))


def counts(part):
    return (
        part.face_count,
        len(part.edges),
        len(part.points),
        part.solid_count,
        int(part.degenerate.sum()),
        int(part.seam.sum()),
    )


def volume(part):
    return sum(cq.Shape.cast(shape).Volume() for shape in root_shapes(document_of(part.handle)))


def exact_volume(shape):
    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, found, 1e-9)
    return found.Mass()


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Each part with its result, made once."""
    made = {}

    def run(name):
        if name not in made:
            folder = tmp_path_factory.mktemp(name)
            made[name] = deformed(parts.write_part(name, folder), BENT, folder)
        return made[name]

    return run


@pytest.mark.parametrize("name", list(parts.PARTS))
def test_same_topology_valid_and_valid_when_read_again(name, bent, tmp_path):
    part, result = bent(name)
    verdict = kernel_check(result.kernel_shape)
    assert (verdict.valid, verdict.closed) == (True, True)
    assert result.write(tmp_path / "old.step", schema="ap203").warnings == ()
    for extension in (".step", ".igs", ".brep"):
        path = tmp_path / f"out{extension}"
        result.write(path)
        again = read_part(path)
        assert again.notes == ()
        assert again.valid
        assert again.shell_closed.all()
        assert counts(again) == counts(part)
        # OpenCascade's reader sets the vertices at poles anew.
        np.testing.assert_allclose(
            np.sort(again.points, axis=0), np.sort(result.deformed.points, axis=0), atol=1e-13
        )


# It reads neither spheres nor solids with cavities, whoever wrote them.
@pytest.mark.parametrize("name", [n for n in parts.PARTS if n not in ("hollow", "sphere")])
def test_a_second_kernel_agrees(name, bent, tmp_path):
    part, result = bent(name)
    path = tmp_path / "out.step"
    result.write(path)
    other = pykentron.importers.importStep(str(path)).val()
    assert len(other.Faces()) == part.face_count
    assert other.Volume() == pytest.approx(exact_volume(result.kernel_shape), rel=2e-5)


def test_pcurves_and_untouched_geometry_stay_to_the_bit(tmp_path):
    lattice = HALF.format(x=0, border="c1")
    part, result = deformed(parts.write_part("plate", tmp_path, ".brep"), lattice, tmp_path)
    kinds = result.report["faces_by"]
    assert kinds["unchanged"] > 0
    assert kinds["fitted"] > 0
    path = tmp_path / "out.brep"
    result.write(path)
    again = read_part(path)
    rng = np.random.default_rng(3)
    for coedge, (old, new) in enumerate(zip(part.pcurves, again.pcurves, strict=True)):
        at = rng.uniform(*part.edge_range[part.coedge_edge[coedge]], 5)
        if part.surfaces[part.face_of_coedge[coedge]].kind != "plane":
            assert np.allclose(old.points(at), new.points(at), rtol=0, atol=1e-14 * 2 * np.pi)
    for face in np.flatnonzero(result.deformed.face_kinds == 0):
        low, high = part.rectangles[face]
        at = rng.uniform(low, high, (9, 2)).T
        assert type(part.surfaces[face]) is type(again.surfaces[face])
        assert np.array_equal(part.surfaces[face].points(*at), again.surfaces[face].points(*at))


@pytest.mark.parametrize("border", ["c0", "c1", "c2"])
def test_a_part_partly_outside_the_box(border, tmp_path):
    lattice = HALF.format(x=0, border=border)
    part, result = deformed(parts.write_part("plate", tmp_path), lattice, tmp_path)
    path = tmp_path / "out.step"
    report = result.write(path).report
    assert report["faces_by"]["unchanged"] >= 3
    again = read_part(path)
    assert counts(again) == counts(part)
    assert again.valid
    kept = [surface.kind for surface in again.surfaces].count("cylinder")
    assert kept == sum(
        surface.kind == "cylinder" and kind == 0
        for surface, kind in zip(part.surfaces, result.deformed.face_kinds, strict=True)
    )


def test_instances_that_the_lattice_leaves_alone_stay_instances(tmp_path):
    path = tmp_path / "assembly.step"
    parts.assembly().export(str(path))
    # The pin in the middle and the one on the left stay; the base is bent on the right.
    lattice = HALF.format(x=4, border="c1")
    part, result = deformed(path, lattice, tmp_path)
    out = tmp_path / "out.step"
    result.write(out)
    again = read_part(out)
    assert counts(again) == counts(part)
    assert again.solid_names == part.solid_names
    document = document_of(again.handle)
    (root,) = roots_of(document)
    below = [referred(each) for each in components_of(root)]
    pins = [name_of(each) for each in components_of(root)]
    assert pins == ["base_part", "pin-0", "pin-1", "pin-2"]
    assert below[1].IsEqual(below[2])
    assert not below[1].IsEqual(below[3])
    for label in (below[1], below[3]):
        assert is_coloured(label)
    np.testing.assert_allclose(
        np.sort(again.points, axis=0), np.sort(result.deformed.points, axis=0), atol=1e-12
    )


def is_coloured(label):
    from OCP.Quantity import Quantity_Color

    found = Quantity_Color()
    kinds = (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen)
    return any(XCAFDoc_ColorTool.GetColor_s(label, kind, found) for kind in kinds)


def test_names_and_colours_of_faces_come_along(tmp_path):
    shape = cq.Workplane().rect(10, 10).extrude(10).edges("|Z").fillet(2).val()
    names = ("Boden, 5' \u65e5\u672c", *(f"face-{n}" for n in range(1, 10)))
    body = BodyLabels("Stück", names, (0, 1) * 5)
    paints = (Material("red", (1.0, 0.0, 0.0)), Material("blue", (0.0, 0.2, 1.0)))
    path = tmp_path / "named.step"
    write_cad(shape.wrapped, path, labels=ShapeLabels("Stück", paints, (body,)))
    part, result = deformed(path, BENT, tmp_path)
    assert part.face_names == names
    assert part.solid_names == ("Stück",)
    out = tmp_path / "out.step"
    result.write(out)
    again = read_part(out)
    assert again.face_names == names
    assert again.solid_names == ("Stück",)
    assert colours_of(again) == colours_of(part)
    assert len(set(colours_of(part))) == 2
    (lost,) = result.write(tmp_path / "out.step", schema="ap203").warnings
    assert lost == "AP203 has no place for colours: they are left out"
    result.write(tmp_path / "out.igs")
    plain = read_part(tmp_path / "out.igs")
    assert plain.face_names == ("Boden, 5' ??", *names[1:])
    assert colours_of(plain) == colours_of(part)


def colours_of(part):
    document = document_of(part.handle)
    found = colours_in(document, number_parts(root_shapes(document)))
    return [tuple(round(share, 4) for share in colour) for colour in found]


def test_an_edge_on_a_plane_that_bends_gets_its_curve_on_the_surface(bent):
    _, result = bent("cylinder")
    shape = result.shape
    assert not any(
        isinstance(BRep_Tool.Surface_s(face.wrapped), Geom_CylindricalSurface)
        for face in shape.Faces()
    )
    for face in shape.Faces():
        for edge in face.Edges():
            pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 1.0)
            surface = BRep_Tool.Surface_s(face.wrapped)
            curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
            for t in np.linspace(*BRep_Tool.Range_s(edge.wrapped), 7):
                spot = pcurve.Value(t)
                off = surface.Value(spot.X(), spot.Y()).Distance(curve.Value(t))
                assert off <= BRep_Tool.Tolerance_s(edge.wrapped)


def test_conics_in_a_bent_plane_come_back_in_the_same_parameter(bent, tmp_path):
    part, result = bent("nut")
    result.write(tmp_path / "out.step")
    again = read_part(tmp_path / "out.step")
    shape = cq.Shape.cast(root_shapes(document_of(again.handle))[0])
    assert shape.isValid()
    for face, old in zip(shape.Faces(), part.surfaces, strict=True):
        if old.kind != "plane":
            continue
        surface = BRep_Tool.Surface_s(face.wrapped)
        for edge in face.Edges():
            pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 1.0)
            curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
            for t in np.linspace(*BRep_Tool.Range_s(edge.wrapped), 12):
                spot = pcurve.Value(t)
                off = surface.Value(spot.X(), spot.Y()).Distance(curve.Value(t))
                assert off < 1e-5 * part.size


def test_lines_in_parameters_come_back_with_the_range_of_their_edges(bent, tmp_path):
    # A reader that is left endless lines projects the ends of edges on them.
    part, result = bent("cylinder")
    result.write(tmp_path / "out.step")
    document, _ = load_document(tmp_path / "out.step", repairs=False)
    found = number_parts(root_shapes(document))
    count = 0
    for face in map(TopoDS.Face_s, map(found.faces.FindKey, range(1, part.face_count + 1))):
        for edge in cq.Shape.cast(face).Edges():
            pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face, 0.0, 1.0)
            ends = BRep_Tool.Range_s(edge.wrapped)
            assert (pcurve.FirstParameter(), pcurve.LastParameter()) == ends
            assert BRep_Tool.Range_s(edge.wrapped, face) == ends
            count += 1
    assert count == len(part.coedge_edge) - part.seam.sum() // 2


def test_faces_outside_of_shells_get_their_poles_back(tmp_path):
    ball = cq.Solid.makeSphere(3, angleDegrees1=0, angleDegrees2=90, angleDegrees3=90)
    dome = next(face for face in ball.Faces() if face.geomType() == "SPHERE")
    dome.exportBrep(str(tmp_path / "dome.brep"))
    part, result = deformed(tmp_path / "dome.brep", BENT, tmp_path)
    result.write(tmp_path / "out.step")
    assert part.degenerate.sum() == 1
    assert counts(read_part(tmp_path / "out.step")) == counts(part)


@pytest.mark.parametrize("extension", [".brep", ".step"])
def test_two_solids_that_share_a_face(extension, tmp_path):
    rods = [cq.Workplane().workplane(offset=z).circle(3).extrude(4).val() for z in (0, 4)]
    glue = BOPAlgo_Builder()
    for rod in rods:
        glue.AddArgument(rod.wrapped)
    glue.Perform()
    cq.Shape.cast(glue.Shape()).exportBrep(str(tmp_path / "rods.brep"))
    part, result = deformed(tmp_path / "rods.brep", BENT, tmp_path)
    assert (part.face_count, part.solid_count) == (5, 2)
    out = tmp_path / f"out{extension}"
    result.write(out)
    # STEP gives each solid a face of its own.
    again = read_part(out)
    assert (again.face_count, again.solid_count) == (5 if extension == ".brep" else 6, 2)
    lattice = read_lattice(tmp_path / "lattice.yaml", part)
    verdict = verify_part_file(out, part, lattice, tolerance=result.max_error)
    assert verdict.passed, (verdict.reasons, verdict.undecided)
    volumes = [exact_volume(each.wrapped) for each in result.shape.Solids()]
    assert verdict.volume == pytest.approx(sum(volumes), rel=1e-5)


def test_a_polyhedron_is_deformed_exactly(tmp_path):
    path = tmp_path / "frame.step"
    frame = cq.Workplane().box(10, 8, 6).faces(">Z").workplane().rect(4, 3).cutThruAll()
    cq.exporters.export(frame, str(path))
    _, result = deformed(path, BENT, tmp_path)
    assert result.exact
    assert result.report["faces"] == 10
    out = tmp_path / "out.step"
    result.write(out)
    again = read_part(out)
    assert (again.valid, again.face_count, again.solid_count) == (True, 10, 1)


def test_the_same_part_can_be_deformed_again(tmp_path):
    path = parts.write_part("plate", tmp_path)
    part, first = deformed(path, BENT, tmp_path)
    first.write(tmp_path / "first.brep")
    _, second = deformed(path, BENT.replace("35", "20"), tmp_path)
    second.write(tmp_path / "second.brep")
    third = deform(part, read_lattice(tmp_path / "lattice.yaml", part))
    third.write(tmp_path / "third.brep")
    assert (tmp_path / "second.brep").read_bytes() == (tmp_path / "third.brep").read_bytes()
    assert volume(part) == pytest.approx(volume(read_part(path)), rel=1e-12)


MIRROR = 'version: 1\nedits: [{transform: {at: [":", ":", ":"], scale: [-1, 1, 1]}}]\n'


@pytest.mark.parametrize("name", ["plate", "hollow", "pair", "torus"])
def test_faces_of_a_mirrored_part_look_outwards(name, tmp_path):
    part, result = deformed(parts.write_part(name, tmp_path), MIRROR, tmp_path)
    assert result.report["jacobian"]["mirrored"]
    assert exact_volume(result.kernel_shape) == pytest.approx(volume(part), rel=1e-3)
    result.write(tmp_path / "out.step")
    again = read_part(tmp_path / "out.step")
    assert (again.valid, again.notes, counts(again)) == (True, (), counts(part))
    assert exact_volume(root_shapes(document_of(again.handle))[0]) > 0


def stated(path):
    document = document_of(read_part(path).handle)
    (label,) = roots_of(document)
    found = [each() for each in (XCAFDoc_Volume, XCAFDoc_Area)]
    if not all(label.IsAttribute(type(each).GetID_s()) for each in found):
        return None
    for each in found:
        label.FindAttribute(type(each).GetID_s(), each)
    return [each.Get() for each in found]


def test_volume_and_area_are_stated_anew_where_the_file_stated_them(tmp_path):
    shape = cq.Workplane().rect(10, 10).extrude(10).edges("|Z").fillet(2).val()
    mass = MassProperties(shape.Volume(), shape.Area(), (0.0, 0.0, 5.0))
    labels = ShapeLabels("rod", (), (BodyLabels("rod", mass=mass),))
    path, out = tmp_path / "stated.step", tmp_path / "out.step"
    write_cad(shape.wrapped, path, labels=labels)
    assert stated(path) == pytest.approx([shape.Volume(), shape.Area()], rel=1e-9)
    _, result = deformed(path, BENT, tmp_path)
    result.write(out)
    found = stated(out)
    assert found[0] == pytest.approx(exact_volume(result.kernel_shape), rel=2e-6)
    assert found[1] != pytest.approx(shape.Area(), rel=1e-2)
    # A file that stated nothing states nothing.
    _, result = deformed(parts.write_part("plate", tmp_path), BENT, tmp_path)
    result.write(out)
    assert stated(out) is None


@pytest.mark.parametrize("name", ["hollow", "sweep", "cone"])
def test_receivers_that_take_no_pcurves(name, bent, tmp_path):
    part, result = bent(name)
    for extension in (".step", ".igs"):
        path = tmp_path / f"out{extension}"
        result.write(path, target="rhino")
        again = read_part(path)
        assert (again.valid, again.face_count) == (True, part.face_count)


def test_a_file_that_is_valid_only_after_repairs_is_not_put_in_place(bent, tmp_path, monkeypatch):
    _, result = bent("cone")
    result.write(tmp_path / "bare.igs", target="rhino")
    bare = (tmp_path / "bare.igs").read_bytes()
    monkeypatch.setattr("ffdcli.brep.occ.part.write.iges_bytes", lambda *_, **__: bare)
    assert read_part(tmp_path / "bare.igs").valid
    with pytest.raises(CheckError, match="OpenCascade does not read the file as it was meant"):
        result.write(tmp_path / "out.igs")
    assert not (tmp_path / "out.igs").exists()


def test_a_file_that_reads_as_another_part_is_not_put_in_place(bent, tmp_path, monkeypatch):
    _, result = bent("cylinder")
    other = parts.write_part("cone", tmp_path)
    monkeypatch.setattr(NewPart, "_step", lambda *_: other.read_bytes())
    with pytest.raises(CheckError, match="it has 2 faces instead of 3"):
        result.write(tmp_path / "out.step")
    assert not (tmp_path / "out.step").exists()


def test_a_solid_that_is_inside_out_is_not_written(tmp_path):
    part, result = deformed(parts.write_part("cylinder", tmp_path), MIRROR, tmp_path)
    turned = replace(result.deformed, mirrored=~result.deformed.mirrored)
    with pytest.raises(CheckError, match="solid 0: it is inside out"):
        replace(result, deformed=turned).write(tmp_path / "out.step")
    assert part.valid
    assert not (tmp_path / "out.step").exists()
