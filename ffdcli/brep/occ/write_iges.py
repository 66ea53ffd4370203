"""Shapes to IGES files, every number at full double precision."""

from __future__ import annotations

import textwrap
import time
import unicodedata
from decimal import ROUND_CEILING, Context
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.header import FileHeader, program, stamp_time
from ffdcli.brep.occ.settings import exchange_settings, tolerance_settings
from ffdcli.brep.occ.silence import silent_kernel
from ffdcli.errors import KernelError
from ffdcli.files import whole_file
from ffdcli.units import Unit, unit_named

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Unit flags of the global section (IGES 5.3, 2.2.4.3.14), by our names.
IGES_UNITS = {"inch": 1, "mm": 2, "ft": 4, "mile": 5, "m": 6, "km": 7, "um": 9, "cm": 10}
# OpenCascade's numbers for the ways to write.
_MODES = {"faces": 0, "brep": 1}
# Characters of text in a line of the start section.
_LINE = 72
# Lines are 80 characters and an end of line; their numbers have seven digits.
_LINE_BYTES = 81
_MOST_LINES = 9_999_999


def write_iges(
    shape: TopoDS_Shape,
    path: str | Path,
    *,
    unit: str = "mm",
    mode: str = "brep",
    name: str = "part",
    header: FileHeader | None = None,
) -> int:
    """Write an IGES 5.3 file, whole or not at all.

    The same shape gives the same bytes but for the time stamp, which ``SOURCE_DATE_EPOCH`` settles.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    path : str or Path
    unit : str
        The unit the numbers are in, for the header; see ``units.UNITS``.
    mode : {"brep", "faces"}
        Solids and shells (entities 186 and 514), which keep the edges that faces share; or trimmed
        surfaces (144), which every reader knows, each with edges of its own. Trimmed surfaces have
        no orientation: those of reversed faces are turned, u running backwards.
    name : str
        Name of the product. Characters beyond ASCII lose their accents or become ``?``.
    header : FileHeader, optional

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError
        An unknown unit or mode, or OpenCascade failed.
    FileError
        The file cannot be written.
    """
    if mode not in _MODES:
        raise KernelError(
            f"there is no way {mode!r} to write IGES", hint=f"use one of {', '.join(_MODES)}"
        )
    length = unit_named(unit)
    with whole_file(path) as stream:
        with silent_kernel(), exchange_settings(tolerance_settings(shape)):
            content = _iges_bytes(
                shape, _MODES[mode], length, Path(path).name, name, header or FileHeader()
            )
        return stream.write(content)


def _iges_bytes(
    shape: TopoDS_Shape, mode: int, unit: Unit, file_name: str, name: str, header: FileHeader
) -> memoryview:
    from OCP.IGESControl import IGESControl_Writer
    from OCP.IGESData import IGESData_IGESWriter
    from OCP.IGESSelect import IGESSelect_WorkLibrary

    writer = IGESControl_Writer("MM", mode)
    model = writer.Model()
    _set_header(model, unit, file_name, name, header)
    if not writer.AddShape(shape):
        raise KernelError(f"OpenCascade could not turn {name!r} into IGES entities")
    writer.ComputeModel()
    section = model.GlobalSection()
    section.SetResolution(_rounded_up(section.Resolution()))
    model.SetGlobalSection(section)
    printer = IGESData_IGESWriter(model)
    # 17 significant digits name every double; the writer's default is ten.
    printer.FloatWriter().SetFormat("%.16E", True)
    printer.FloatWriter().SetZeroSuppress(False)
    printer.SendModel(IGESSelect_WorkLibrary.DefineProtocol_s())
    # An error in a stream's write ends the process from inside the kernel: only memory is safe
    # to print to.
    buffer = BytesIO()
    if not printer.Print(buffer) or buffer.tell() == 0:
        raise KernelError(f"OpenCascade could not print the IGES entities of {name!r}")
    if buffer.tell() > _MOST_LINES * _LINE_BYTES:
        raise KernelError(
            f"the model is too large for IGES: it would take {buffer.tell() // _LINE_BYTES} lines,"
            f" and no more than {_MOST_LINES} can be numbered",
            hint="write STEP, or a coarser mesh",
        )
    return buffer.getbuffer()


def _set_header(model: Any, unit: Unit, file_name: str, name: str, header: FileHeader) -> None:
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(iges_text(value))

    for line in textwrap.wrap(iges_text(header.description), _LINE):
        model.AddStartLine(line)
    moment = text(time.strftime("%Y%m%d.%H%M%S", stamp_time()))
    section = model.GlobalSection()
    kernel = section.InterfaceVersion().ToCString()
    section.SetUnitFlag(IGES_UNITS[unit.name])
    section.SetUnitName(text(unit.kernel))
    # Only where both units agree are numbers left as they are.
    section.SetCascadeUnit(unit.millimetres)
    section.SetSendName(text(name))
    section.SetReceiveName(text(name))
    section.SetFileName(text(file_name))
    section.SetSystemId(text(program()))
    section.SetInterfaceVersion(text(f"{program()} with {kernel}"))
    section.SetAuthorName(text(header.author))
    section.SetCompanyName(text(header.organisation))
    section.SetDate(moment)
    section.SetLastChangeDate(moment)
    model.SetGlobalSection(section)


def _rounded_up(value: float) -> float:
    """Round up to the six digits that headers have, so that a tolerance stays true."""
    return float(Context(prec=6, rounding=ROUND_CEILING).create_decimal_from_float(value))


def iges_text(value: str) -> str:
    """Spell any text in the characters IGES files may hold, which are those of ASCII."""
    plain = unicodedata.normalize("NFKD", value)
    kept = (character for character in plain if not unicodedata.combining(character))
    return "".join(character if " " <= character <= "~" else "?" for character in kept)
