"""Whether OpenCascade finds parts valid: shapes, and files as they are, without its repairs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ffdcli.brep.occ.part.document import root_shapes
from ffdcli.brep.occ.part.load import load_document
from ffdcli.brep.occ.part.walk import Numbering, number_parts


def read_unrepaired(path: str | Path) -> tuple[Any, str | None, bool]:
    """The document of a CAD file without repairs, the unit it states, and whether it is valid.

    Where it is not valid as it stands, only what its format leaves out is added: edges at poles
    and apexes, second sides of seams, curves on planar splines.

    Raises
    ------
    FileError
        As :func:`~ffdcli.brep.occ.part.load.load_document`.
    """
    for complete in (False, True):
        document, unit = load_document(path, repairs=False, complete=complete)
        valid = lacking_pcurve(number_parts(root_shapes(document))) is None and is_valid(document)
        if valid:
            break
    return document, unit, valid


def is_valid(document: Any) -> bool:
    """Whether OpenCascade finds all shapes of a document valid."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    return all(BRepCheck_Analyzer(shape, True).IsValid() for shape in root_shapes(document))


def lacking_pcurve(found: Numbering) -> int | None:
    """Number of the first face, no plane, with an edge that has no curve in its parameters.

    OpenCascade's check may end the process on such faces.
    """
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_Plane
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    for number in range(1, found.faces.Extent() + 1):
        face = TopoDS.Face_s(found.faces.FindKey(number))
        if isinstance(BRep_Tool.Surface_s(face), Geom_Plane):
            continue
        edges = TopExp_Explorer(face, Kind.TopAbs_EDGE)
        while edges.More():
            edge = TopoDS.Edge_s(edges.Current())
            if BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0) is None:
                return number
            edges.Next()
    return None
