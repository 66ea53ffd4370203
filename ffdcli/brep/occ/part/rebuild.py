"""Shapes with new geometry on the same topology.

What keeps its geometry stays the same shape. Everything else is copied with the new geometry in its
place: orientation, order, locations and pcurves stay as they were read.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from ffdcli.brep.occ.part.build import breaks_of, build_curve, build_surface
from ffdcli.brep.occ.part.walk import Numbering, children
from ffdcli.part.record import NewGeometry, Part
from ffdcli.part.surfaces import Plane

# Of splines in place of conics: largest deviation as a share of the extent, pieces, degree.
_SHARE, _PIECES, _DEGREE = 1e-12, 100, 14


class Rebuild:
    """New shapes for the shapes of a part.

    Parameters
    ----------
    part : Part
    found : Numbering
        Of the shapes of the part's document.
    new : NewGeometry
    """

    def __init__(self, part: Part, found: Numbering, new: NewGeometry) -> None:
        from OCP.BRep import BRep_Builder
        from OCP.TopTools import TopTools_IndexedMapOfShape

        self._part, self._found, self._new = part, found, new
        self._builder = BRep_Builder()
        self._known, self._made = TopTools_IndexedMapOfShape(), list[Any]()
        self._surfaces: dict[int, Any] = {}
        self._coedges: dict[int, list[int]] = defaultdict(list)
        for coedge, edge in enumerate(part.coedge_edge.tolist()):
            self._coedges[edge].append(coedge)
        self._moved = np.any(new.points != part.points, axis=1) | (
            new.vertex_tolerance != part.vertex_tolerance
        )
        faces = part.face_of_coedge
        touched = np.zeros(len(part.edges), dtype=bool)
        changed = np.array([surface is not None for surface in new.surfaces])
        np.logical_or.at(touched, part.coedge_edge, changed[faces])
        self._edge_changed = touched | (new.edge_tolerance != part.edge_tolerance)
        self._edge_changed |= np.array([curve is not None for curve in new.curves], dtype=bool)
        self._range_changed = np.any(new.edge_range != part.edge_range, axis=1)

    def __call__(self, shape: Any) -> Any:
        """The new shape of a shape where it stands; the same where nothing of it has changed."""
        place = self._known.FindIndex(shape)
        if not place:
            made = self._rebuilt(shape)
            self._known.Add(shape)
            self._made.append(made)
            place = len(self._made)
        return self._made[place - 1].Oriented(shape.Orientation())

    def _rebuilt(self, shape: Any) -> Any:
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopAbs import TopAbs_ShapeEnum as Kind

        shape = shape.Oriented(TopAbs_Orientation.TopAbs_FORWARD)
        kind = shape.ShapeType()
        if kind == Kind.TopAbs_VERTEX:
            return self._vertex(shape)
        old = list(children(shape))
        new = [self(child) for child in old]
        changed = not all(a.IsPartner(b) for a, b in zip(old, new, strict=True))
        if kind == Kind.TopAbs_EDGE:
            number = self._found.edges.FindIndex(shape) - 1
            if not changed and (number < 0 or not self._edge_changed[number]):
                return shape
            made = self._edge(shape, number)
        elif kind == Kind.TopAbs_FACE:
            number = self._found.faces.FindIndex(shape) - 1
            if not changed and self._new.surfaces[number] is None:
                return shape
            made = self._face(shape, number)
        elif not changed:
            return shape
        else:
            made = shape.EmptyCopied()
        turned = kind == Kind.TopAbs_SHELL and self._is_mirrored(shape)
        for child in new:
            self._builder.Add(made, child.Reversed() if turned else child)
        made.Closed(shape.Closed())
        return made

    def _is_mirrored(self, shell: Any) -> bool:
        """Whether the faces of a shell are to be turned."""
        face = self._found.faces.FindIndex(next(children(shell))) - 1
        return bool(self._new.mirrored[self._part.face_shell[face]])

    def _vertex(self, shape: Any) -> Any:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        number = self._found.vertices.FindIndex(shape) - 1
        if number < 0 or not self._moved[number]:
            return shape
        point = gp_Pnt(*self._new.points[number].tolist())
        location = shape.Location()
        if not location.IsIdentity():
            point.Transform(location.Transformation().Inverted())
        made = TopoDS_Vertex()
        self._builder.MakeVertex(made, point, float(self._new.vertex_tolerance[number]))
        return made.Located(location)

    def _edge(self, shape: Any, number: int) -> Any:
        from OCP.TopoDS import TopoDS

        made = TopoDS.Edge_s(shape.EmptyCopied())
        if number < 0:
            return made
        edge = made.TShape()
        edge.Tolerance(float(self._new.edge_tolerance[number]))
        curves = edge.ChangeCurves()
        old = list(curves)
        curves.Clear()
        for each in old:
            if each.IsCurve3D():
                curve = self._new.curves[number]
                if curve is not None:
                    each.Curve3D(_local(build_curve(curve), shape.Location()))
                    each.Location(_nowhere())
                    each.SetRange(*self._new.edge_range[number].tolist())
                curves.Append(each)
        faces = list(dict.fromkeys(self._part.face_of_coedge[self._coedges[number]].tolist()))
        # Faces on one surface have the same curve.
        on_faces = [each for face in faces for each in self._on_face(shape, old, number, face)]
        for each in [*dict.fromkeys(on_faces), *self._regularities(shape, faces)]:
            curves.Append(each)
        return made

    def _on_face(self, shape: Any, old: list[Any], edge: int, number: int) -> list[Any]:
        """Curves of an edge in the parameters of a face."""
        from OCP.BRep import BRep_CurveOnClosedSurface, BRep_CurveOnSurface
        from OCP.GeomAbs import GeomAbs_Shape

        face = self._found.faces.FindKey(number + 1)
        surface, location = _surface_of(face)
        location = location.Predivided(shape.Location())
        known = [each for each in old if each.IsCurveOnSurface(surface, location)]
        if self._new.surfaces[number] is None:
            # OpenCascade computes the curves on planes.
            return [] if self._range_changed[edge] and _is_plane(surface) else known
        target, place = self._surface(number), face.Location().Predivided(shape.Location())
        if _is_plane(target):
            return []
        plane = self._new.planes[number]
        if plane is not None or not known:
            known = [_made_pcurve(shape, face, plane)]
        out = []
        for each in known:
            ends = each.First(), each.Last()
            first = _as_spline(each.PCurve(), *ends)
            if each.IsCurveOnClosedSurface():
                second = _as_spline(each.PCurve2(), *ends)
                smooth = min(each.Continuity(), GeomAbs_Shape.GeomAbs_G1, key=int)
                made = BRep_CurveOnClosedSurface(first, second, target, place, smooth)
            else:
                made = BRep_CurveOnSurface(first, target, place)
            made.SetRange(*ends)
            out.append(made)
        return out

    def _regularities(self, shape: Any, faces: list[int]) -> list[Any]:
        """How smoothly the two faces of an edge meet, as far as deforming them keeps it."""
        from OCP.BRep import BRep_CurveOn2Surfaces, BRep_Tool
        from OCP.GeomAbs import GeomAbs_Shape
        from OCP.TopoDS import TopoDS

        if len(faces) != 2:
            return []
        pair = [TopoDS.Face_s(self._found.faces.FindKey(number + 1)) for number in faces]
        edge = TopoDS.Edge_s(shape)
        if not BRep_Tool.HasContinuity_s(edge, *pair):
            return []
        smooth = BRep_Tool.Continuity_s(edge, *pair)
        targets, places = [], []
        for number, face in zip(faces, pair, strict=True):
            if self._new.surfaces[number] is None:
                surface, location = _surface_of(face)
            else:
                surface, location = self._surface(number), face.Location()
                smooth = min(smooth, GeomAbs_Shape.GeomAbs_G1, key=int)
            targets.append(surface)
            places.append(location.Predivided(shape.Location()))
        return [BRep_CurveOn2Surfaces(*targets, *places, smooth)]

    def _face(self, shape: Any, number: int) -> Any:
        made = shape.EmptyCopied()
        face = made.TShape()
        face.NaturalRestriction(shape.TShape().NaturalRestriction())
        if self._new.surfaces[number] is not None:
            face.Surface(self._surface(number))
            face.Location(_nowhere())
        return made

    def _surface(self, number: int) -> Any:
        """The new surface of a face, in the frame of the face."""
        if number not in self._surfaces:
            location = self._found.faces.FindKey(number + 1).Location()
            surface = self._new.surfaces[number]
            assert surface is not None
            self._surfaces[number] = _local(build_surface(surface), location)
        return self._surfaces[number]


def _surface_of(face: Any) -> tuple[Any, Any]:
    """The surface that a face refers to, and where it stands."""
    shape = face.TShape()
    return shape.Surface(), face.Location().Multiplied(shape.Location())


def _local(geometry: Any, location: Any) -> Any:
    """Geometry in the frame of a location."""
    if location.IsIdentity():
        return geometry
    return geometry.Transformed(location.Transformation().Inverted())


def _nowhere() -> Any:
    from OCP.TopLoc import TopLoc_Location

    return TopLoc_Location()


def _is_plane(surface: Any) -> bool:
    from OCP.Geom import Geom_Plane

    return isinstance(surface, Geom_Plane)


def _made_pcurve(shape: Any, face: Any, plane: Plane | None) -> Any:
    """The curve of an edge on a planar face, which OpenCascade stores none of.

    In the parameters of the face's own surface, or of a plane in model coordinates.
    """
    from OCP.BRep import BRep_CurveOnSurface, BRep_Tool
    from OCP.TopoDS import TopoDS

    edge = TopoDS.Edge_s(shape)
    surface, location = _surface_of(face)
    if plane is not None:
        surface, location = build_surface(plane), _nowhere()
    pcurve = BRep_Tool.CurveOnPlane_s(edge, surface, location, 0.0, 1.0)
    made = BRep_CurveOnSurface(pcurve, surface, location)
    made.SetRange(*BRep_Tool.Range_s(edge))
    return made


def _as_spline(pcurve: Any, first: float, last: float) -> Any:
    """A line or conic as a spline between two values of its parameter.

    OpenCascade's STEP reader cuts endless lines where they leave the surface, which fails for lines
    that run along its side but for a rounding. Circles and ellipses would be written as rational
    splines in another parameter, so that its reader has to fit them anew; it fails on hyperbolas.
    """
    from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Conic, Geom2d_Line, Geom2d_TrimmedCurve
    from OCP.Geom2dConvert import Geom2dConvert_ApproxCurve
    from OCP.GeomAbs import GeomAbs_Shape
    from OCP.TColgp import TColgp_Array1OfPnt2d

    if isinstance(pcurve, Geom2d_Line):
        poles = TColgp_Array1OfPnt2d(1, 2)
        for number, at in enumerate((first, last), start=1):
            poles.SetValue(number, pcurve.Value(at))
        return Geom2d_BSplineCurve(poles, *breaks_of(np.repeat([first, last], 2)), 1)
    if not isinstance(pcurve, Geom2d_Conic):
        return pcurve
    piece = Geom2d_TrimmedCurve(pcurve, first, last)
    start, middle, end = map(piece.Value, (first, (first + last) / 2, last))
    extent = max(start.Distance(end), start.Distance(middle))
    return Geom2dConvert_ApproxCurve(
        piece, _SHARE * extent, GeomAbs_Shape.GeomAbs_C2, _PIECES, _DEGREE
    ).Curve()
