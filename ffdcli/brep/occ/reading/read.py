"""STEP, IGES and BREP files to shapes, nothing repaired."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.formats import CAD_FORMATS, cad_format
from ffdcli.brep.occ.reading.truncation import is_whole_brep, is_whole_iges
from ffdcli.brep.occ.settings import exchange_settings
from ffdcli.brep.occ.silence import silent_kernel
from ffdcli.errors import FileError
from ffdcli.units import UNITS, Unit

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from ffdcli.brep.readback import ReadBrep

# The reader's repairs; without them a flipped face, an inverted solid, a missing or doubled face
# come back as they were written.
HEALING = (
    "FixFreeShellMode",
    "FixFreeFaceMode",
    "FixFreeWireMode",
    "FixSameParameterMode",
    "FixSolidMode",
    "FixShellMode",
    "FixFaceMode",
    "FixWireMode",
    "FixShellOrientationMode",
    "FixFaceOrientationMode",
    "FixVertexPositionMode",
    "FixVertexToleranceMode",
)

# Trimmed surfaces come without vertices. Of all repairs only those are left on that put the curves
# of a loop in order and make one vertex of the ends of curves that follow each other.
_CONNECTING = ("FixFreeFaceMode", "FixFaceMode", "FixWireMode")
HEALING_BUT_CONNECTING = (
    *(mode for mode in HEALING if mode not in _CONNECTING),
    "FixOrientationMode",
    "FixAddNaturalBoundMode",
    "FixMissingSeamMode",
    "FixSmallAreaWireMode",
    "FixIntersectingWiresMode",
    "FixLoopWiresMode",
    "FixSplitFaceMode",
    "FixSmallMode",
    "FixEdgeCurvesMode",
    "FixDegeneratedMode",
    "FixLackingMode",
    "FixSelfIntersectionMode",
    "FixNotchedEdgesMode",
    "FixTailMode",
)
# IGES entities that say which edges faces share: solids, faces, shells.
SHARING = (186, 510, 514)


@dataclass(frozen=True)
class ReadModel:
    """A CAD file as the kernel sees it.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its coordinates are the numbers in the file.
    unit : str or None
        The unit those numbers are in, by the file's header; None where the format has none.
    resolution : float or None, model length
        Distance within which edges count as one, in files of trimmed surfaces, whose faces share
        no edges; None where the file says which edges are one.
    """

    shape: TopoDS_Shape
    unit: str | None
    resolution: float | None = None


def read_cad(path: str | Path) -> ReadModel:
    """Read a CAD file by its extension, with healing switched off and its numbers unscaled.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    FileError
        The file is missing, of no known kind, or holds nothing that OpenCascade can read.
    """
    readers = {"STEP": read_step, "IGES": read_iges, "BREP": read_brep}
    kind = cad_format(path)
    if kind is None:
        raise FileError(
            "this is no CAD file by its extension",
            file=str(path),
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    return readers[kind](path)


def record_of(model: ReadModel) -> ReadBrep:
    """Turn what was read into plain arrays; edges of trimmed surfaces that coincide are joined.

    Parameters
    ----------
    model : ReadModel

    Raises
    ------
    KernelError
        A face or edge has geometry that this program cannot judge.
    """
    from ffdcli.brep.join import join_faces
    from ffdcli.brep.occ.reading.extract import extract

    read = extract(model.shape)
    return read if model.resolution is None else join_faces(read, model.resolution)


def read_step(path: str | Path) -> ReadModel:
    """Read a STEP file with OpenCascade's healing switched off and its numbers unscaled.

    In files without curves in the parameters of faces (pcurves) the edges' curves are projected.
    Of a seam, which STEP files do not say the two sides of, the pcurves may come back in either
    order.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    ReadModel

    Raises
    ------
    FileError
        The file is missing, is no STEP file, holds no shape, mixes units, or holds something
        OpenCascade cannot read.
    """
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader

    name = _require_file(path, "STEP")
    with silent_kernel(), exchange_settings({"read.precision.mode": "File"}):
        reader = STEPControl_Reader()
        try:
            status = reader.ReadFile(name)
        except Exception as error:
            raise _unreadable(name, "STEP") from error
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise _unreadable(name, "STEP")
        roots = reader.NbRootsForTransfer()
        if roots == 0:
            raise FileError("the file holds no shapes", file=name)
        unit = _file_unit(reader, name)
        reader.SetSystemLengthUnit(unit.millimetres)
        with _switched_off(reader, HEALING):
            shape = _transfer(reader, roots, name)
        _apply_tolerance(reader, shape)
        if not reader.GiveList("xst-types(StepGeom_Pcurve)").Length():
            _add_pcurves(shape)
        return ReadModel(shape, unit.name)


def read_iges(path: str | Path) -> ReadModel:
    """Read an IGES file with OpenCascade's healing switched off and its numbers unscaled.

    Of trimmed surfaces (entity 144), whose boundary curves have no vertices, the ends of curves
    that follow each other are made one vertex: without that no face is valid.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    ReadModel

    Raises
    ------
    FileError
        The file is missing, is no IGES file, holds no shape, states no unit this program knows, or
        holds something OpenCascade cannot read.
    """
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.IGESControl import IGESControl_Reader

    name = _require_file(path, "IGES")
    if not is_whole_iges(Path(name)):
        raise _unreadable(name, "IGES")
    # Splines are taken as they are, not cut where they are not C1.
    settings = {"read.precision.mode": "File", "read.iges.bspline.continuity": "0"}
    with silent_kernel(), exchange_settings(settings):
        reader = IGESControl_Reader()
        try:
            status = reader.ReadFile(name)
        except Exception as error:
            raise _unreadable(name, "IGES") from error
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise _unreadable(name, "IGES")
        roots = reader.NbRootsForTransfer()
        if roots == 0:
            raise FileError("the file holds no shapes", file=name)
        model = reader.IGESModel()
        section = model.GlobalSection()
        unit = _iges_unit(section, name)
        section.SetCascadeUnit(unit.millimetres)
        model.SetGlobalSection(section)
        entities = map(model.Entity, range(1, model.NbEntities() + 1))
        shared = any(entity.TypeNumber() in SHARING for entity in entities)
        with _switched_off(reader, HEALING if shared else HEALING_BUT_CONNECTING):
            shape = _transfer(reader, roots, name)
        resolution = section.Resolution()
        _limit_tolerance(shape, resolution)
        return ReadModel(shape, unit.name, None if shared else resolution)


def read_brep(path: str | Path) -> ReadModel:
    """Read one of OpenCascade's own text files (.brep), which state no unit.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    FileError
        The file is missing, or is no such file.
    """
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    name = _require_file(path, "BREP")
    if not is_whole_brep(Path(name)):
        raise _unreadable(name, "BREP")
    shape = TopoDS_Shape()
    with silent_kernel():
        try:
            done = BRepTools.Read_s(shape, name, BRep_Builder())
        except Exception as error:
            raise _unreadable(name, "BREP") from error
    if not done or shape.IsNull():
        raise _unreadable(name, "BREP")
    return ReadModel(shape, None)


def _require_file(path: str | Path, kind: str) -> str:
    if not Path(path).is_file():
        problem = "this is a folder" if Path(path).is_dir() else "there is no such file"
        raise FileError(problem, file=str(path), hint=f"give the name of a {kind} file")
    return str(path)


def _transfer(reader: Any, roots: int, name: str) -> Any:
    """Make the shapes of a file that has been loaded."""
    transferred = reader.TransferRoots()
    if transferred != roots or reader.NbShapes() == 0:
        raise FileError(
            f"OpenCascade could make only {transferred} of the {roots} parts in the file",
            file=name,
        )
    return reader.OneShape()


def _unreadable(name: str, kind: str) -> FileError:
    article = "an" if kind == "IGES" else "a"
    return FileError(
        f"this is not {article} {kind} file that OpenCascade can read, or it is cut short",
        file=name,
    )


def _file_unit(reader: Any, name: str) -> Unit:
    """Return the one length unit of a file that has been loaded."""
    from OCP.TColStd import TColStd_SequenceOfAsciiString

    lengths, angles, solid_angles = (TColStd_SequenceOfAsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    found = {lengths.Value(i).ToCString().lower() for i in range(1, lengths.Length() + 1)}
    units = [unit for unit in UNITS if unit.step in found]
    if len(units) != 1 or len(found) != 1:
        raise FileError(
            f"the file's unit of length cannot be told: it names {sorted(found) or 'none'}",
            file=name,
        )
    return units[0]


def _iges_unit(section: Any, name: str) -> Unit:
    """Return the unit of length that a global section states."""
    for unit in UNITS:
        if unit.iges == section.UnitFlag():
            return unit
    raise FileError(
        "the file's unit of length cannot be told: its flag is "
        f"{section.UnitFlag()}, its name {section.UnitName().ToCString()!r}",
        file=name,
    )


def _add_pcurves(shape: TopoDS_Shape) -> None:
    """Give edges pcurves on the faces that need them, by projection."""
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


def _apply_tolerance(reader: Any, shape: TopoDS_Shape) -> None:
    """Give the shape the tolerance a STEP file states; without healing the reader leaves 1e-7."""
    stated = reader.GiveList("xst-types(StepBasic_UncertaintyMeasureWithUnit)")
    values = [stated.Value(i).ValueComponent() for i in range(1, stated.Length() + 1)]
    if values:
        _limit_tolerance(shape, max(values))


def _limit_tolerance(shape: TopoDS_Shape, least: float) -> None:
    from OCP.ShapeFix import ShapeFix_ShapeTolerance

    ShapeFix_ShapeTolerance().LimitTolerance(shape, least)


@contextmanager
def _switched_off(reader: Any, repairs: tuple[str, ...]) -> Iterator[None]:
    """Switch repairs of a reader off for the length of a block.

    OpenCascade's IGES readers share these parameters: other users of the library want them back.
    """
    from OCP.Resource import Resource_DataMapOfAsciiStringAsciiString
    from OCP.TCollection import TCollection_AsciiString

    off = Resource_DataMapOfAsciiStringAsciiString()
    for mode in repairs:
        off.Bind(TCollection_AsciiString(f"FixShape.{mode}"), TCollection_AsciiString("0"))
    before = Resource_DataMapOfAsciiStringAsciiString(reader.GetShapeFixParameters())
    reader.SetShapeFixParameters(off)
    try:
        yield
    finally:
        reader.SetShapeFixParameters(before)
