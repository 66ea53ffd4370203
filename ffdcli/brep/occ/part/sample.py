"""Points of a shape's faces, edges and pcurves by OpenCascade's own evaluation, for verification.

Nothing here knows the records of :mod:`ffdcli.part`: OpenCascade evaluates its own geometry, point
by point, and plain arrays are handed out. A point costs a few microseconds.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.occ.part.walk import Numbering, children, is_reversed, number_parts, unshared

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Tolerance of "inside the outline", in surface parameters: that of OpenCascade for equal ones.
_ON = 1e-9


@dataclass(frozen=True, eq=False)
class SampledShape:
    """The topology of a shape in arrays, and its geometry as OpenCascade evaluates it.

    Parameters
    ----------
    points : (V, 3) float64, model length
        Vertices.
    edges : (E, 2) int64
        Vertices at the start and end of each edge; -1 for none.
    degenerate : (E,) bool
        The edge is a point.
    edge_breaks : (E,) tuple of float64 arrays
        Ends of the edge's range, and the parameters between where its curve is not smooth. Two
        zeros for edges without a curve.
    edge_tolerance : (E,) float64, model length
    face_reversed : (F,) bool
        The outward normal is opposite to ``du cross dv``.
    face_shell : (F,) int64
    face_breaks : (F,) tuple of pairs of float64 arrays
        For u and for v: the ends of what the face reaches, and the values between where its
        surface is not smooth.
    coedge_face, coedge_edge : (C,) int64
    coedge_forward : (C,) bool
        The loop, about the outward normal, runs the edge from its start to its end.
    coedge_breaks : (C,) tuple of float64 arrays
        As ``edge_breaks``, of the pcurve.
    seam : (C,) bool
        The face has the edge twice, once on either side of its parameters.
    shell_closed : (S,) bool
    shell_solid : (S,) int64
        -1 for none.
    solid_count : int
    faces, surfaces, outlines, curves, pcurves : tuple
        OpenCascade's, of faces, faces, faces, edges and coedges. None where there is none.
    """

    points: Floats
    edges: Ints
    degenerate: Bools
    edge_breaks: tuple[Floats, ...]
    edge_tolerance: Floats
    face_reversed: Bools
    face_shell: Ints
    face_breaks: tuple[tuple[Floats, Floats], ...]
    coedge_face: Ints
    coedge_edge: Ints
    coedge_forward: Bools
    coedge_breaks: tuple[Floats, ...]
    seam: Bools
    shell_closed: Bools
    shell_solid: Ints
    solid_count: int
    faces: tuple[Any, ...]
    surfaces: tuple[Any, ...]
    outlines: tuple[Any, ...]
    curves: tuple[Any, ...]
    pcurves: tuple[Any, ...]

    def on_faces(self, face: Ints, uv: Floats) -> tuple[Floats, Floats]:
        """Positions (n, 3) and tangents (n, 2, 3) of faces (n,) at parameters (n, 2).

        Tangents are zero where the surface has none.
        """
        from OCP.Geom import Geom_UndefinedDerivative
        from OCP.gp import gp_Pnt, gp_Vec

        point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
        rows = []
        for number, u, v in zip(face.tolist(), *uv.T.tolist(), strict=True):
            try:
                self.surfaces[number].D1(u, v, point, along_u, along_v)
            except Geom_UndefinedDerivative:
                # No tangents at some points of offset surfaces.
                along_u, along_v = gp_Vec(), gp_Vec()
                point = self.surfaces[number].Value(u, v)
            rows.append(point.Coord() + along_u.Coord() + along_v.Coord())
        values = np.array(rows, dtype=np.float64).reshape(-1, 3, 3)
        return values[:, 0], values[:, 1:]

    def inside(self, face: Ints, uv: Floats) -> Bools:
        """(n,) whether parameters (n, 2) lie inside or on the outlines of faces (n,).

        Outlines are polygons near the pcurves, off by up to some per cent.
        """
        from OCP.gp import gp_Pnt2d
        from OCP.TopAbs import TopAbs_State

        place, outside = gp_Pnt2d(), TopAbs_State.TopAbs_OUT
        found = []
        for number, u, v in zip(face.tolist(), *uv.T.tolist(), strict=True):
            place.SetCoord(u, v)
            found.append(self.outlines[number].Perform(place) != outside)
        return np.array(found, dtype=bool)

    def surely_inside(self, face: Ints, uv: Floats) -> Bools:
        """As :meth:`inside`, by the pcurves themselves, which takes many times longer."""
        from OCP.BRepClass import BRepClass_FaceClassifier
        from OCP.gp import gp_Pnt2d
        from OCP.TopAbs import TopAbs_State

        outside, classifier = TopAbs_State.TopAbs_OUT, BRepClass_FaceClassifier()
        found = []
        for number, u, v in zip(face.tolist(), *uv.T.tolist(), strict=True):
            classifier.Perform(self.faces[number], gp_Pnt2d(u, v), _ON)
            found.append(classifier.State() != outside)
        return np.array(found, dtype=bool)

    def on_edges(self, edge: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Positions and tangents, (n, 3) each, of edges (n,) at parameters (n,)."""
        from OCP.gp import gp_Pnt, gp_Vec

        point, along = gp_Pnt(), gp_Vec()
        rows = []
        for number, t in zip(edge.tolist(), at.tolist(), strict=True):
            self.curves[number].D1(t, point, along)
            rows.append(point.Coord() + along.Coord())
        values = np.array(rows, dtype=np.float64).reshape(-1, 2, 3)
        return values[:, 0], values[:, 1]

    def on_pcurves(self, coedge: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Surface parameters and their derivatives, (n, 2) each, at parameters (n,) of pcurves."""
        from OCP.gp import gp_Pnt2d, gp_Vec2d

        point, along = gp_Pnt2d(), gp_Vec2d()
        rows = []
        for number, t in zip(coedge.tolist(), at.tolist(), strict=True):
            self.pcurves[number].D1(t, point, along)
            rows.append((point.X(), point.Y(), along.X(), along.Y()))
        values = np.array(rows, dtype=np.float64).reshape(-1, 2, 2)
        return values[:, 0], values[:, 1]


def sampled(shapes: Iterable[TopoDS_Shape]) -> SampledShape:
    """Shapes as topology and points, without repairs; solids that share a face have one each."""
    found = number_parts(unshared(list(shapes)))
    return SampledShape(**_faces(found), **_edges(found), **_shells(found))


def _faces(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
    from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
    from OCP.TopAbs import TopAbs_Orientation as Sense
    from OCP.TopoDS import TopoDS

    faces, surfaces, outlines, breaks, pcurve_breaks = [], [], [], [], []
    pcurves: list[Any] = []
    coedges: list[tuple[int, int, bool, bool]] = []
    for number, turned in enumerate(found.face_reversed):
        face = TopoDS.Face_s(found.faces.FindKey(number + 1).Oriented(Sense.TopAbs_FORWARD))
        surface = BRepAdaptor_Surface(face, True)
        faces.append(face)
        surfaces.append(surface)
        outlines.append(BRepTopAdaptor_FClass2d(face, _ON))
        breaks.append((_breaks(surface, "U"), _breaks(surface, "V")))
        for wire in children(face):
            for child in children(wire):
                edge = TopoDS.Edge_s(child)
                if edge.Orientation() not in (Sense.TopAbs_FORWARD, Sense.TopAbs_REVERSED):
                    continue
                place = found.edges.FindIndex(edge) - 1
                seam = BRep_Tool.IsClosed_s(edge, face)
                coedges.append((number, place, is_reversed(edge) == turned, seam))
                pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
                if pcurve is None:
                    pcurves.append(None)
                    pcurve_breaks.append(np.zeros(2))
                    continue
                adaptor = Geom2dAdaptor_Curve(pcurve, *BRep_Tool.Range_s(edge, face))
                pcurves.append(adaptor)
                pcurve_breaks.append(_breaks(adaptor))
    of_face, of_edge, forward, seams = zip(*coedges, strict=True) if coedges else ((),) * 4
    return {
        "faces": tuple(faces),
        "surfaces": tuple(surfaces),
        "outlines": tuple(outlines),
        "face_breaks": tuple(breaks),
        "face_reversed": np.array(found.face_reversed, dtype=bool),
        "coedge_face": np.array(of_face, dtype=np.int64),
        "coedge_edge": np.array(of_edge, dtype=np.int64),
        "coedge_forward": np.array(forward, dtype=bool),
        "seam": np.array(seams, dtype=bool),
        "pcurves": tuple(pcurves),
        "coedge_breaks": tuple(pcurve_breaks),
    }


def _edges(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS

    count = found.edges.Extent()
    ends = np.full((count, 2), -1)
    tolerances, degenerate = np.zeros(count), np.zeros(count, dtype=bool)
    curves, breaks = [], []
    for number in range(count):
        key = found.edges.FindKey(number + 1)
        edge = TopoDS.Edge_s(key.Oriented(TopAbs_Orientation.TopAbs_FORWARD))
        for side, vertex in enumerate((TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge))):
            if not vertex.IsNull():
                ends[number, side] = found.vertices.FindIndex(vertex) - 1
        tolerances[number] = BRep_Tool.Tolerance_s(edge)
        degenerate[number] = BRep_Tool.Degenerated_s(edge)
        bare = degenerate[number] or BRep_Tool.Curve_s(edge, 0.0, 1.0) is None
        curve = None if bare else BRepAdaptor_Curve(edge)
        curves.append(curve)
        breaks.append(np.zeros(2) if curve is None else _breaks(curve))
    vertices = (found.vertices.FindKey(i + 1) for i in range(found.vertices.Extent()))
    points = [BRep_Tool.Pnt_s(TopoDS.Vertex_s(vertex)).Coord() for vertex in vertices]
    return {
        "points": np.array(points, dtype=np.float64).reshape(-1, 3),
        "edges": ends,
        "degenerate": degenerate,
        "edge_tolerance": tolerances,
        "curves": tuple(curves),
        "edge_breaks": tuple(breaks),
    }


def _shells(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool

    closed = [shell is not None and BRep_Tool.IsClosed_s(shell) for shell, _ in found.shells]
    return {
        "face_shell": np.array(found.face_shell, dtype=np.int64),
        "shell_closed": np.array(closed, dtype=bool),
        "shell_solid": np.array([solid for _, solid in found.shells], dtype=np.int64),
        "solid_count": len(found.solids),
    }


def _breaks(adaptor: Any, axis: str = "") -> Floats:
    """Ends of an adaptor's domain, and the parameters between where it is not smooth."""
    from OCP.GeomAbs import GeomAbs_Shape
    from OCP.TColStd import TColStd_Array1OfReal

    smooth = GeomAbs_Shape.GeomAbs_CN
    count = getattr(adaptor, f"Nb{axis}Intervals")(smooth)
    found = TColStd_Array1OfReal(1, count + 1)
    getattr(adaptor, f"{axis}Intervals")(found, smooth)
    return np.array([found.Value(i) for i in range(1, count + 2)])
