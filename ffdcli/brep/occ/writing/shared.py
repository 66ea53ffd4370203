"""Surfaces that several faces of a shape trim, each written to a file once.

OpenCascade makes the entities of a surface anew for each of its faces. Here the later ones give way
to those of the first face. Which entities stand for one surface is known from the shape, never from
coordinates.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterator
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.writing.document import bodies_of, faces_of

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# IGES entities that are faces: trimmed surface, face of a shell.
_FACES = (144, 510)


def shared_surfaces(
    shape: TopoDS_Shape, *, oriented: bool = False
) -> list[list[tuple[int, TopoDS_Shape]]]:
    """The faces of each surface that several faces trim.

    Parameters
    ----------
    shape : TopoDS_Shape
    oriented : bool
        Whether faces of opposite orientation have different surfaces.

    Returns
    -------
    list of lists of (int, TopoDS_Shape)
        Faces with their numbers in the order of the shape.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    faces = (face for body in bodies_of(shape) for face in faces_of(body))
    found = defaultdict(list)
    for number, face in enumerate(faces):
        # A surface is the same Python object as long as that object lives.
        surface = BRep_Tool.Surface_s(TopoDS.Face_s(face))
        found[surface, face.Orientation() if oriented else None].append((number, face))
    return [each for each in found.values() if len(each) > 1]


def share_step_surfaces(session: Any, shape: TopoDS_Shape) -> None:
    """Make the STEP faces of one surface, and their pcurves, refer to one entity."""
    from OCP.STEPConstruct import STEPConstruct

    finder = session.TransferWriter().FinderProcess()
    kept: dict[Any, Any] = {}
    for faces in shared_surfaces(shape):
        entities = [STEPConstruct.FindEntity_s(finder, face) for _, face in faces]
        first = entities[0].FaceGeometry()
        for entity in entities[1:]:
            kept[entity.FaceGeometry()] = first
            entity.SetFaceGeometry(first)
            for pcurve in _pcurves_of(entity):
                surface = pcurve.BasisSurface()
                pcurve.SetBasisSurface(kept.get(surface, surface))
    if kept:
        _drop(session.Model(), kept)


def _pcurves_of(face: Any) -> Iterator[Any]:
    """Pcurves of the edges of a STEP face, both those on it and those on the faces beside it."""
    for bound in _items(face.Bounds()):
        for oriented in _items(bound.Bound().EdgeList()):
            curve = oriented.EdgeElement().EdgeGeometry()
            # An edge without pcurves has its space curve alone.
            if hasattr(curve, "AssociatedGeometry"):
                yield from (each.Pcurve() for each in _items(curve.AssociatedGeometry()))


def _items(array: Any) -> Iterator[Any]:
    return map(array.Value, range(array.Lower(), array.Upper() + 1))


def iges_faces(model: Any) -> list[Any]:
    """The faces of a new IGES model, in the order of its shape."""
    entities = map(model.Entity, range(1, model.NbEntities() + 1))
    return [entity for entity in entities if entity.TypeNumber() in _FACES]


def share_iges_surfaces(model: Any, shape: TopoDS_Shape, *, solids: bool) -> None:
    """Make the IGES faces of one surface refer to one entity.

    Parameters
    ----------
    model : IGESData_IGESModel
    shape : TopoDS_Shape
    solids : bool
        Whether the faces are those of solids and shells. Trimmed surfaces have no orientation:
        those of reversed faces have turned surfaces.
    """
    groups = shared_surfaces(shape, oriented=not solids)
    if not groups:
        return
    faces, dropped = iges_faces(model), set()
    for group in groups:
        entities = [faces[number] for number, _ in group]
        surface = entities[0].Surface()
        if hasattr(surface, "UMin"):
            _extend(surface)
        for entity in entities[1:]:
            dropped.add(entity.Surface())
            (_set_face_surface if solids else _set_trimmed_surface)(entity, surface)
    _drop(model, dropped)


def _extend(surface: Any) -> None:
    """Extend the stated parameters of an IGES B-spline surface from one face to all its knots."""
    from OCP.TColgp import TColgp_HArray2OfXYZ
    from OCP.TColStd import TColStd_HArray1OfReal, TColStd_HArray2OfReal

    last_u, last_v = surface.UpperIndexU(), surface.UpperIndexV()
    degree_u, degree_v = surface.DegreeU(), surface.DegreeV()
    knots_u = TColStd_HArray1OfReal(-degree_u, last_u + 1)
    for i in range(-degree_u, last_u + 2):
        knots_u.SetValue(i, surface.KnotU(i))
    knots_v = TColStd_HArray1OfReal(-degree_v, last_v + 1)
    for j in range(-degree_v, last_v + 2):
        knots_v.SetValue(j, surface.KnotV(j))
    weights = TColStd_HArray2OfReal(0, last_u, 0, last_v)
    poles = TColgp_HArray2OfXYZ(0, last_u, 0, last_v)
    for i in range(last_u + 1):
        for j in range(last_v + 1):
            weights.SetValue(i, j, surface.Weight(i, j))
            poles.SetValue(i, j, surface.Pole(i, j).XYZ())
    surface.Init(
        last_u,
        last_v,
        degree_u,
        degree_v,
        surface.IsClosedU(),
        surface.IsClosedV(),
        surface.IsPolynomial(False),
        surface.IsPeriodicU(),
        surface.IsPeriodicV(),
        knots_u,
        knots_v,
        weights,
        poles,
        knots_u.Value(0),
        knots_u.Value(last_u + 1 - degree_u),
        knots_v.Value(0),
        knots_v.Value(last_v + 1 - degree_v),
    )


def _set_face_surface(face: Any, surface: Any) -> None:
    from OCP.IGESSolid import IGESSolid_HArray1OfLoop

    loops = IGESSolid_HArray1OfLoop(1, face.NbLoops())
    for place in range(1, face.NbLoops() + 1):
        loops.SetValue(place, face.Loop(place))
    face.Init(surface, face.HasOuterLoop(), loops)


def _set_trimmed_surface(face: Any, surface: Any) -> None:
    from OCP.IGESGeom import IGESGeom_HArray1OfCurveOnSurface

    outer = face.OuterContour()
    inner = [face.InnerContour(place) for place in range(1, face.NbInnerContours() + 1)]
    for contour in (outer, *inner):
        contour.Init(
            contour.CreationMode(),
            surface,
            contour.CurveUV(),
            contour.Curve3D(),
            contour.PreferenceMode(),
        )
    contours = IGESGeom_HArray1OfCurveOnSurface(1, len(inner))
    for place, contour in enumerate(inner):
        contours.SetValue(place + 1, contour)
    face.Init(surface, face.OuterBoundaryType(), outer, contours if inner else None)


def _drop(model: Any, dropped: Container[Any]) -> None:
    """Remove entities that no other refers to, and what only they refer to, from a model."""
    from OCP.Interface import Interface_ShareTool

    found, roots = Interface_ShareTool(model, model.Protocol()).RootEntities(), []
    found.Start()
    while found.More():
        roots.append(found.Value())
        found.Next()
    model.ClearEntities()
    for root in roots:
        if root not in dropped:
            # With what it refers to, in the order in which OpenCascade numbers a new model.
            model.AddWithRefs(root)
