"""Faults of parts: edges repaired with OpenCascade's own tools, others named with their place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.part.document import root_shapes
from ffdcli.brep.occ.part.walk import Numbering
from ffdcli.messages import counted, place_text

if TYPE_CHECKING:
    from ffdcli.part.record import Part

# Faults that are named one by one.
_NAMED = 3
# Distance of an edge's end from its vertex that is said, as a share of the size.
_AWAY = 1e-5


def settle_edges(found: Numbering) -> list[str]:
    """Give edges a curve in space, and pcurves of the same parameter; sentences on what was done.

    The shapes themselves are changed.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepLib import BRepLib
    from OCP.TopoDS import TopoDS

    bare, apart = 0, 0
    for number in range(1, found.edges.Extent() + 1):
        edge = TopoDS.Edge_s(found.edges.FindKey(number))
        if BRep_Tool.Degenerated_s(edge):
            continue
        if BRep_Tool.Curve_s(edge, 0.0, 1.0) is None:
            bare += BRepLib.BuildCurve3d_s(edge)
        if not (BRep_Tool.SameParameter_s(edge) and BRep_Tool.SameRange_s(edge)):
            BRepLib.SameRange_s(edge)
            BRepLib.SameParameter_s(edge, BRep_Tool.Tolerance_s(edge))
            apart += 1
    notes = []
    if bare:
        had = counted(bare, "edge had", "edges had")
        notes.append(f"{had} no curve in space: OpenCascade made it from the curve on a face")
    if apart:
        had = counted(apart, "edge had", "edges had")
        notes.append(f"{had} curves of different parameters: OpenCascade made them agree")
    return notes


def describe_faults(document: Any, found: Numbering, part: Part) -> list[str]:
    """Sentences on the faults that remain: faces that are not valid, and open edges of solids."""
    notes = []
    loose = sum(map(_loose_edges, root_shapes(document)))
    if loose:
        lie = counted(loose, "curve lies", "curves lie")
        notes.append(f"{lie} outside of faces: no lattice moves them")
    if not part.valid:
        notes.append(_invalid(document, found, part))
    notes += _loose_ends(part)
    uses = np.bincount(part.coedge_edge, minlength=len(part.edges))
    ending = (uses == 1) & ~part.degenerate
    if ending.any():
        edge = int(np.argmax(ending))
        face = int(part.face_of_coedge[np.argmax(part.coedge_edge == edge)])
        are = counted(int(ending.sum()), "edge belongs", "edges belong")
        notes.append(
            f"the part is open: {are} to one face only, the first to {part.named_face(face)} "
            f"near {_middle(part, edge)}"
        )
    return notes


def _loose_ends(part: Part) -> list[str]:
    """A sentence on edges that end away from their vertices, which are cut anew by readers."""
    gaps, places = np.zeros(len(part.edges)), np.zeros((len(part.edges), 3))
    for edge, curve in enumerate(part.curves):
        known = part.edges[edge] >= 0
        if curve is not None and known.any():
            ends = curve.points(part.edge_range[edge][known])
            off = np.linalg.norm(ends - part.points[part.edges[edge][known]], axis=1)
            gaps[edge], places[edge] = off.max(), ends[np.argmax(off)]
    away = int((gaps > _AWAY * part.size).sum())
    if not away:
        return []
    worst = int(np.argmax(gaps))
    return [
        f"{counted(away, 'edge ends', 'edges end')} away from their vertices, edge {worst + 1} by "
        f"{gaps[worst]:.3g} near {place_text(places[worst])}: readers of STEP and IGES files cut "
        "such edges where they are nearest"
    ]


def _loose_edges(shape: Any) -> int:
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopExp import TopExp_Explorer

    edges, count = TopExp_Explorer(shape, Kind.TopAbs_EDGE, Kind.TopAbs_FACE), 0
    while edges.More():
        count += 1
        edges.Next()
    return count


def _invalid(document: Any, found: Numbering, part: Part) -> str:
    from OCP.BRepCheck import BRepCheck_Analyzer

    numbers = range(1, found.faces.Extent() + 1)
    wrong = [n - 1 for n in numbers if not BRepCheck_Analyzer(found.faces.FindKey(n)).IsValid()]
    if wrong:
        places = ", ".join(
            f"{part.named_face(face)} near {place_text(_centre(part, face))}"
            for face in wrong[:_NAMED]
        )
        more = f" and {len(wrong) - _NAMED} more" if len(wrong) > _NAMED else ""
        return f"OpenCascade does not find the part valid: {places}{more}"
    faults = [fault for shape in root_shapes(document) for fault in kernel_check(shape).faults]
    return f"OpenCascade does not find the part valid: {'; '.join(faults[:_NAMED])}"


def _centre(part: Part, face: int) -> Any:
    middle = part.rectangles[face].mean(axis=0)
    return part.surfaces[face].points(middle[0], middle[1])


def _middle(part: Part, edge: int) -> str:
    curve = part.curves[edge]
    if curve is None:
        return "a point"
    return place_text(curve.points(part.edge_range[edge].mean()))
