"""STEP files to shapes, nothing repaired."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.settings import exchange_settings
from ffdcli.brep.occ.silence import silent_kernel
from ffdcli.errors import FileError
from ffdcli.units import UNITS, Unit

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

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


@dataclass(frozen=True)
class ReadModel:
    """A CAD file as the kernel sees it.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its coordinates are the numbers in the file.
    unit : str
        The unit those numbers are in, by the file's header.
    """

    shape: TopoDS_Shape
    unit: str


def read_step(path: str | Path) -> ReadModel:
    """Read a STEP file with OpenCascade's healing switched off and its numbers unscaled.

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

    name = str(path)
    if not Path(path).is_file():
        problem = "this is a folder" if Path(path).is_dir() else "there is no such file"
        raise FileError(problem, file=name, hint="give the name of a STEP file")
    with silent_kernel(), exchange_settings({"read.precision.mode": "File"}):
        reader = STEPControl_Reader()
        try:
            status = reader.ReadFile(name)
        except Exception as error:
            raise _unreadable(name) from error
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise _unreadable(name)
        roots = reader.NbRootsForTransfer()
        if roots == 0:
            raise FileError("the file holds no shapes", file=name)
        unit = _file_unit(reader, name)
        reader.SetSystemLengthUnit(unit.millimetres)
        _switch_healing_off(reader)
        transferred = reader.TransferRoots()
        if transferred != roots or reader.NbShapes() == 0:
            raise FileError(
                f"OpenCascade could make only {transferred} of the {roots} parts in the file",
                file=name,
            )
        shape = reader.OneShape()
        _apply_tolerance(reader, shape)
        return ReadModel(shape, unit.name)


def _unreadable(name: str) -> FileError:
    return FileError(
        "this is not a STEP file that OpenCascade can read, or it is cut short", file=name
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


def _apply_tolerance(reader: Any, shape: TopoDS_Shape) -> None:
    """Give the shape the tolerance the file states; without healing the reader leaves 1e-7."""
    from OCP.ShapeFix import ShapeFix_ShapeTolerance

    stated = reader.GiveList("xst-types(StepBasic_UncertaintyMeasureWithUnit)")
    values = [stated.Value(i).ValueComponent() for i in range(1, stated.Length() + 1)]
    if values:
        ShapeFix_ShapeTolerance().LimitTolerance(shape, max(values))


def _switch_healing_off(reader: Any) -> None:
    from OCP.Resource import Resource_DataMapOfAsciiStringAsciiString
    from OCP.TCollection import TCollection_AsciiString

    off = Resource_DataMapOfAsciiStringAsciiString()
    for mode in HEALING:
        off.Bind(TCollection_AsciiString(f"FixShape.{mode}"), TCollection_AsciiString("0"))
    reader.SetShapeFixParameters(off)
