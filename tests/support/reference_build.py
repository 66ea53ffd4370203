"""The shape of a record built object by object: what the binary stream is compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.brep.record import Brep
from ffdcli.errors import KernelError
from support.reference_geometry import (
    asking,
    integer_array,
    make_curves,
    make_surfaces,
    real_array,
    surface_count,
)

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


def build_shape(brep: Brep) -> TopoDS_Shape:
    """Make the shape of a boundary representation: one vertex and one edge object each, shared.

    A straight edge between planes becomes a line with its length as parameter; every other edge
    keeps its B-spline curve on [0, 1] with straight pcurves of the same parameter.

    Parameters
    ----------
    brep : Brep
        All lengths are taken as they are.

    Returns
    -------
    TopoDS_Shape
        The solid or open shell, or a compound of them where there are several.

    Raises
    ------
    KernelError
        OpenCascade refused something; the message says what it was asked to make.
    """
    from OCP.BRep import BRep_Builder
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS_Vertex

    builder = BRep_Builder()
    vertices = []
    with asking("vertex {}") as at:
        for i, (point, tolerance) in enumerate(
            zip(brep.points.tolist(), brep.vertex_tolerance.tolist(), strict=True)
        ):
            at(i)
            vertex = TopoDS_Vertex()
            builder.MakeVertex(vertex, gp_Pnt(*point), tolerance)
            vertices.append(vertex)
    surfaces = make_surfaces(brep)
    edges = _make_edges(builder, brep, vertices)
    _add_pcurves(builder, brep, edges, surfaces)
    faces = _make_faces(builder, brep, edges, surfaces)
    return _assemble(builder, brep, faces)


def _make_edges(builder: Any, brep: Brep, vertices: list[Any]) -> list[Any]:
    """Make every edge with its 3D curve, range and vertices."""
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS_Edge

    reverse = TopAbs_Orientation.TopAbs_REVERSED
    ends = brep.edges.tolist()
    tolerances = brep.edge_tolerance.tolist()
    reversed_vertices = [vertex.Oriented(reverse) for vertex in vertices]
    edges: list[Any] = [None] * len(ends)
    between_planes = _between_planes(brep)
    for batch in brep.curves:
        curves = make_curves(batch, between_planes[batch.edges])
        with asking("edge {}") as at:
            for number, (curve, last) in zip(batch.edges.tolist(), curves, strict=True):
                at(number)
                edge = TopoDS_Edge()
                builder.MakeEdge(edge, curve, tolerances[number])
                builder.Range(edge, 0.0, last)
                start, end = ends[number]
                builder.Add(edge, vertices[start])
                builder.Add(edge, reversed_vertices[end])
                edges[number] = edge
    return edges


def _coedge_faces(brep: Brep) -> Ints:
    """Return the face of every coedge."""
    loops = np.diff(brep.face_loops)
    loop_faces = np.repeat(np.arange(len(loops)), loops)
    return np.repeat(loop_faces, np.diff(brep.loop_coedges))


def _on_plane(brep: Brep) -> Bools:
    """Tell, surface by surface, which are planes."""
    flat = np.zeros(surface_count(brep), dtype=bool)
    flat[brep.planes.surfaces] = True
    return flat


def _between_planes(brep: Brep) -> Bools:
    """Tell, edge by edge, which border nothing but planes."""
    flat = _on_plane(brep)[brep.face_surface][_coedge_faces(brep)]
    answer = np.ones(len(brep.edges), dtype=bool)
    answer[brep.coedge_edge[~flat]] = False
    return answer


def _add_pcurves(builder: Any, brep: Brep, edges: list[Any], surfaces: list[Any]) -> None:
    """Give every edge its straight pcurve on each B-spline surface it borders.

    An edge that borders one surface twice (a slit, or two faces that trim the same surface) has
    one pcurve if both uses agree; else one for each sense, as the kernel keeps a seam.
    """
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.gp import gp_Pnt2d
    from OCP.TColgp import TColgp_Array1OfPnt2d
    from OCP.TopLoc import TopLoc_Location

    face = _coedge_faces(brep)
    surface = brep.face_surface[face]
    used = np.flatnonzero(~_on_plane(brep)[surface])
    in_face = brep.coedge_forward ^ brep.face_reversed[face]
    # Coedges sorted by (edge, surface); the forward use of a seam comes first.
    order = used[np.lexsort((~in_face[used], surface[used], brep.coedge_edge[used]))]
    pairs = np.column_stack((brep.coedge_edge[order], surface[order]))
    starts = np.flatnonzero(np.r_[True, (np.diff(pairs, axis=0) != 0).any(axis=1)][: len(order)])
    counts = np.diff(np.r_[starts, len(order)])
    edge_numbers, surface_numbers = pairs[starts].T.tolist()
    tolerances = brep.edge_tolerance.tolist()

    knots, mults = real_array([0.0, 1.0]), integer_array(np.array([2, 2]))
    pole_array = TColgp_Array1OfPnt2d(1, 2)
    start, end = gp_Pnt2d(), gp_Pnt2d()
    here = TopLoc_Location()

    def straight(ends: list[list[float]]) -> Any:
        start.SetCoord(*ends[0])
        end.SetCoord(*ends[1])
        pole_array.SetValue(1, start)
        pole_array.SetValue(2, end)
        return Geom2d_BSplineCurve(pole_array, knots, mults, 1)

    pcurves = brep.pcurves[order]
    with asking("the pcurve of edge {} on surface {}") as at:
        for first, count, e, s in zip(
            starts.tolist(), counts.tolist(), edge_numbers, surface_numbers, strict=True
        ):
            at(e, s)
            own = pcurves[first : first + count]
            if count == 1 or (own == own[0]).all():
                builder.UpdateEdge(
                    edges[e], straight(own[0].tolist()), surfaces[s], here, tolerances[e]
                )
                continue
            if count != 2 or in_face[order[first]] == in_face[order[first + 1]]:
                raise KernelError(
                    f"edge {e} lies on surface {s} {count} times with different parameters; "
                    "a CAD edge can do so twice, once in each sense"
                )
            forward, backward = (straight(ends) for ends in own.tolist())
            builder.UpdateEdge(edges[e], forward, backward, surfaces[s], here, tolerances[e])


def _make_faces(builder: Any, brep: Brep, edges: list[Any], surfaces: list[Any]) -> list[Any]:
    """Make every face with its wires, oriented so that its normal points outwards."""
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

    reverse = TopAbs_Orientation.TopAbs_REVERSED
    backward_edges = [edge.Oriented(reverse) for edge in edges]
    tolerance = float(brep.edge_tolerance.min(initial=np.inf))
    face_loops, loop_coedges = brep.face_loops.tolist(), brep.loop_coedges.tolist()
    coedge_edge, coedge_forward = brep.coedge_edge.tolist(), brep.coedge_forward.tolist()
    make_wire, add = builder.MakeWire, builder.Add
    faces = []
    with asking("face {}") as at:
        for number, (surface, turned) in enumerate(
            zip(brep.face_surface.tolist(), brep.face_reversed.tolist(), strict=True)
        ):
            at(number)
            face = TopoDS_Face()
            builder.MakeFace(face, surfaces[surface], tolerance)
            for loop in range(face_loops[number], face_loops[number + 1]):
                # The kernel's wires run round the surface's normal, ours round the outward one.
                coedges = range(loop_coedges[loop], loop_coedges[loop + 1])
                wire = TopoDS_Wire()
                make_wire(wire)
                for coedge in reversed(coedges) if turned else coedges:
                    edge = coedge_edge[coedge]
                    forward = coedge_forward[coedge] != turned
                    add(wire, edges[edge] if forward else backward_edges[edge])
                wire.Closed(True)
                add(face, wire)
            faces.append(face.Oriented(reverse) if turned else face)
    return faces


def _assemble(builder: Any, brep: Brep, faces: list[Any]) -> TopoDS_Shape:
    """Put faces into shells, shells into solids, and several of these into a compound."""
    from OCP.TopoDS import TopoDS_Compound, TopoDS_Shell, TopoDS_Solid

    with asking("the shells of {} faces") as at:
        at(len(faces))
        shells = []
        for closed in brep.shell_closed.tolist():
            shell = TopoDS_Shell()
            builder.MakeShell(shell)
            shell.Closed(closed)
            shells.append(shell)
        for face, number in zip(faces, brep.face_shell.tolist(), strict=True):
            builder.Add(shells[number], face)
        solids: dict[int, Any] = {}
        loose = []
        for shell, number in zip(shells, brep.shell_solid.tolist(), strict=True):
            if number < 0:
                loose.append(shell)
                continue
            if number not in solids:
                solids[number] = TopoDS_Solid()
                builder.MakeSolid(solids[number])
            builder.Add(solids[number], shell)
        parts = [solids[number] for number in sorted(solids)] + loose
        if len(parts) == 1:
            return parts[0]
        compound = TopoDS_Compound()
        builder.MakeCompound(compound)
        for part in parts:
            builder.Add(compound, part)
        return compound
