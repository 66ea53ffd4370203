"""STEP files as OpenCascade shapes, without repairs."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.entities import entities
from ffdcli.brep.occ.reading.loading import (
    HEALING,
    ReadModel,
    limit_tolerance,
    load,
    switched_off,
    transfer,
)
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel
from ffdcli.errors import FileError
from ffdcli.files import require_file
from ffdcli.units import UNITS, Unit

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


def read_step(path: str | Path) -> ReadModel:
    """Read a STEP file with OpenCascade's healing switched off and its numbers unscaled.

    In files without pcurves, the curves of edges are projected. The two pcurves of a seam may come
    in either order, as STEP files do not distinguish them.

    Raises
    ------
    FileError
        The file is missing, is no STEP file, holds no shape, mixes units, or holds something
        OpenCascade cannot read.
    """
    from OCP.STEPControl import STEPControl_Reader
    from OCP.StepGeom import StepGeom_Pcurve

    require_file(path, "give the name of a STEP file")
    name = str(path)
    with silent_kernel(), exchange_settings({"read.precision.mode": "File"}):
        reader = STEPControl_Reader()
        roots = load(reader, name, "STEP")
        unit = file_unit(reader, name)
        reader.SetSystemLengthUnit(unit.millimetres)
        with switched_off(reader, HEALING):
            shape = transfer(reader, roots, name)
        apply_tolerance(reader, shape)
        if next(entities(reader.Model(), StepGeom_Pcurve), None) is None:
            _add_pcurves(shape)
        return ReadModel(shape, unit.name, surface_of=_shared_surfaces(reader))


def file_unit(reader: Any, name: str) -> Unit:
    """Return the length unit of a loaded file."""
    from OCP.TColStd import TColStd_SequenceOfAsciiString

    lengths, angles, solid_angles = (TColStd_SequenceOfAsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    found = {lengths.Value(i).ToCString().lower() for i in range(1, lengths.Length() + 1)}
    units = [unit for unit in UNITS if unit.step in found]
    if len(units) != 1 or len(found) != 1:
        raise FileError(
            f"unknown unit of length: the file names {sorted(found) or 'none'}",
            file=name,
        )
    return units[0]


def _shared_surfaces(reader: Any) -> dict[Any, Any]:
    """Surface of each face of the file (by its ``TShape``), where several faces trim it."""
    from OCP.StepShape import StepShape_FaceSurface
    from OCP.XSControl import XSControl_Utils

    process, shape_of = reader.WS().TransferReader().TransientProcess(), XSControl_Utils()
    places = defaultdict(list)
    for place in range(1, process.NbMapped() + 1):
        entity = process.Mapped(place)
        if isinstance(entity, StepShape_FaceSurface):
            # An entity is the same Python object as long as that object lives.
            places[entity.FaceGeometry()].append(place)
    # The binding takes no derived class where it asks for the base class, which ``This`` returns.
    return {
        shape.TShape(): surface
        for surface, found in places.items()
        if len(found) > 1
        for place in found
        if not (shape := shape_of.BinderShape(process.MapItem(place).This())).IsNull()
    }


def _add_pcurves(shape: TopoDS_Shape) -> None:
    """Add missing pcurves by projection."""
    from OCP.BRep import BRep_Tool
    from OCP.ShapeFix import ShapeFix_Edge
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    fixer = ShapeFix_Edge()
    faces = TopExp_Explorer(shape, Kind.TopAbs_FACE)
    while faces.More():
        face = TopoDS.Face_s(faces.Current())
        edges = TopExp_Explorer(face, Kind.TopAbs_EDGE)
        while edges.More():
            edge = TopoDS.Edge_s(edges.Current())
            if BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0) is None:
                fixer.FixAddPCurve(edge, face, False, BRep_Tool.Tolerance_s(edge))
            edges.Next()
        faces.Next()


def apply_tolerance(reader: Any, shape: TopoDS_Shape) -> None:
    """Apply the tolerance that a STEP file states; without healing the reader leaves 1e-7."""
    from OCP.StepBasic import StepBasic_UncertaintyMeasureWithUnit

    stated = entities(reader.Model(), StepBasic_UncertaintyMeasureWithUnit)
    values = [each.ValueComponent() for each in stated]
    if values:
        limit_tolerance(shape, max(values))
