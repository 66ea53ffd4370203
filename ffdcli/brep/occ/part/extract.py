"""Shapes of CAD parts as plain records, without repairs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, run_numbers
from ffdcli.brep.occ.part.geometry import read_curve, read_surface
from ffdcli.brep.occ.part.walk import Numbering, children, is_reversed
from ffdcli.errors import KernelError
from ffdcli.part.bounds import measure_bounds
from ffdcli.part.curves import Curve
from ffdcli.part.outlines import rectangles_of, trace_outlines
from ffdcli.part.surfaces import Offset, Surface

# OpenCascade calls 2e100 what has no end.
_ENDLESS = 1e50


def extract(found: Numbering) -> dict[str, Any]:
    """The fields of a :class:`~ffdcli.part.record.Part` that hold topology and geometry.

    Raises
    ------
    KernelError
        A curve or surface is of no known kind; the message names edge or face.
    """
    topology, domains = _faces(found)
    edges, vertices = _edges(found), _vertices(found)
    ranges, pcurves = edges["edge_range"], topology["pcurves"]
    along = ranges[topology["coedge_edge"]]
    outlines = trace_outlines(
        pcurves,
        along,
        topology["coedge_forward"],
        topology["loop_coedges"],
        topology["face_loops"],
    )
    rectangles = rectangles_of(topology["surfaces"], domains, outlines)
    endless = np.flatnonzero(np.abs(rectangles).max(axis=(1, 2)) > _ENDLESS)
    if len(endless):
        raise KernelError(f"face {endless[0] + 1} has no outline, and its surface no end")
    surfaces = tuple(map(_settled, topology["surfaces"], rectangles))
    faces = run_numbers(topology["face_loops"])[run_numbers(topology["loop_coedges"])]
    borders = list(zip(faces.tolist(), pcurves, along, strict=True))
    bounds = measure_bounds(
        vertices["points"], edges["curves"], ranges, surfaces, rectangles, outlines, borders
    )
    placed = {"surfaces": surfaces, "rectangles": rectangles, "bounds": bounds}
    return {**topology, **edges, **vertices, **_shells(found), **placed}


def _settled(surface: Surface, rectangle: Floats) -> Surface:
    """The surface; one at a distance from another knows the middle of its face."""
    if not isinstance(surface, Offset):
        return surface
    middle = rectangle.mean(axis=0)
    return replace(surface, middle=(float(middle[0]), float(middle[1])))


def _faces(found: Numbering) -> tuple[dict[str, Any], Floats]:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS

    forward = TopAbs_Orientation.TopAbs_FORWARD
    surfaces, domains, tolerances = [], [], []
    face_loops, loop_coedges = [0], [0]
    coedge_edge: list[int] = []
    coedge_forward: list[bool] = []
    pcurves: list[Curve | None] = []
    seam: list[bool] = []
    for number, turned in enumerate(found.face_reversed):
        face = TopoDS.Face_s(found.faces.FindKey(number + 1).Oriented(forward))
        surface = BRep_Tool.Surface_s(face)
        surfaces.append(read_surface(surface, f"face {number + 1}"))
        domains.append(surface.Bounds())
        tolerances.append(BRep_Tool.Tolerance_s(face))
        for wire in children(face):
            # OpenCascade's wires run about the surface's normal, loops about the outward normal.
            inside = list(children(wire))
            backward = is_reversed(wire) != turned
            for child in reversed(inside) if backward else inside:
                edge = TopoDS.Edge_s(child)
                place = found.edges.FindIndex(edge)
                coedge_edge.append(place - 1)
                coedge_forward.append(is_reversed(edge) == turned)
                pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
                pcurves.append(
                    None if pcurve is None else read_curve(pcurve, f"the pcurve of edge {place}")
                )
                seam.append(BRep_Tool.IsClosed_s(edge, face))
            loop_coedges.append(len(coedge_edge))
        face_loops.append(len(loop_coedges) - 1)
    topology = {
        "surfaces": tuple(surfaces),
        "face_tolerance": np.array(tolerances),
        "face_reversed": np.array(found.face_reversed, dtype=bool),
        "face_loops": np.array(face_loops),
        "loop_coedges": np.array(loop_coedges),
        "coedge_edge": np.array(coedge_edge, dtype=np.int64),
        "coedge_forward": np.array(coedge_forward, dtype=bool),
        "pcurves": tuple(pcurves),
        "seam": np.array(seam, dtype=bool),
    }
    # Low and high u, low and high v.
    return topology, np.array(domains).reshape(-1, 2, 2).transpose(0, 2, 1)


def _edges(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS

    count = found.edges.Extent()
    ends = np.full((count, 2), -1)
    ranges, tolerances = np.zeros((count, 2)), np.zeros(count)
    degenerate, same = np.zeros((2, count), dtype=bool)
    curves: list[Curve | None] = []
    for number in range(count):
        key = found.edges.FindKey(number + 1)
        edge = TopoDS.Edge_s(key.Oriented(TopAbs_Orientation.TopAbs_FORWARD))
        for side, vertex in enumerate((TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge))):
            if not vertex.IsNull():
                ends[number, side] = found.vertices.FindIndex(vertex) - 1
        ranges[number] = BRep_Tool.Range_s(edge)
        tolerances[number] = BRep_Tool.Tolerance_s(edge)
        degenerate[number] = BRep_Tool.Degenerated_s(edge)
        same[number] = BRep_Tool.SameParameter_s(edge)
        curve = None if degenerate[number] else BRep_Tool.Curve_s(edge, 0.0, 1.0)
        curves.append(None if curve is None else read_curve(curve, f"edge {number + 1}"))
    return {
        "edges": ends,
        "curves": tuple(curves),
        "edge_range": ranges,
        "edge_tolerance": tolerances,
        "degenerate": degenerate,
        "same_parameter": same,
    }


def _vertices(found: Numbering) -> dict[str, Floats]:
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    numbers = range(1, found.vertices.Extent() + 1)
    vertices = [TopoDS.Vertex_s(found.vertices.FindKey(number)) for number in numbers]
    points = [BRep_Tool.Pnt_s(vertex).Coord() for vertex in vertices]
    return {
        "points": np.array(points, dtype=np.float64).reshape(-1, 3),
        "vertex_tolerance": np.array([BRep_Tool.Tolerance_s(vertex) for vertex in vertices]),
    }


def _shells(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool

    closed = [shell is not None and BRep_Tool.IsClosed_s(shell) for shell, _ in found.shells]
    return {
        "face_shell": np.array(found.face_shell, dtype=np.int64),
        "shell_closed": np.array(closed, dtype=bool),
        "shell_solid": np.array([solid for _, solid in found.shells], dtype=np.int64),
    }
