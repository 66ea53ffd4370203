"""Shapes to STEP files, every number at full double precision unless fewer digits are asked for."""

from __future__ import annotations

import re
import time
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.header import FileHeader, program, stamp_time
from ffdcli.brep.occ.settings import exchange_settings, tolerance_settings
from ffdcli.brep.occ.silence import silent_kernel
from ffdcli.errors import KernelError
from ffdcli.files import whole_file
from ffdcli.units import unit_named

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# The most digits with which OpenCascade can leave trailing zeros out: it looks for the exponent in
# the first 16 characters.
SHORT_DIGITS = 13
# Every pcurve comes with a context of its own; all say the same.
_CONTEXT = re.compile(
    rb"#(\d+) = \( GEOMETRIC_REPRESENTATION_CONTEXT\(2\)\s+"
    rb"PARAMETRIC_REPRESENTATION_CONTEXT\(\)\s+REPRESENTATION_CONTEXT\('2D SPACE',''\s*\) \);\n"
)
_PCURVE = re.compile(rb"(= DEFINITIONAL_REPRESENTATION\('',\s*\(#\d+\),\s*)#\d+\)")

SCHEMAS = {"ap203": "AP203", "ap214": "AP214IS", "ap242": "AP242DIS"}


def write_step(
    shape: TopoDS_Shape,
    path: str | Path,
    *,
    unit: str = "mm",
    schema: str = "ap214",
    name: str = "part",
    header: FileHeader | None = None,
    digits: int = 17,
) -> int:
    """Write a STEP file, whole or not at all.

    The same shape gives the same bytes but for the time stamp, which ``SOURCE_DATE_EPOCH``
    settles (AP203 files hold the local time as well).

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    path : str or Path
    unit : str
        The unit the numbers are in, for the header; see ``units.UNITS``.
    schema : {"ap203", "ap214", "ap242"}
    name : str
        Name of the product.
    header : FileHeader, optional
    digits : int
        Significant digits; 17 name every double. Up to 13, trailing zeros are left out.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError
        An unknown unit or schema, or OpenCascade failed.
    FileError
        The file cannot be written.
    """
    if schema not in SCHEMAS:
        raise KernelError(
            f"there is no STEP schema {schema!r}", hint=f"use one of {', '.join(SCHEMAS)}"
        )
    kernel_unit = unit_named(unit).kernel
    settings = {
        "write.step.schema": SCHEMAS[schema],
        # Only where both units agree are numbers left as they are.
        "write.step.unit": kernel_unit,
        "xstep.cascade.unit": kernel_unit,
        **tolerance_settings(shape),
    }
    with whole_file(path) as stream:
        with silent_kernel(), exchange_settings(settings):
            content = _step_bytes(shape, Path(path).name, name, header or FileHeader(), digits)
        return stream.write(_with_one_context(content))


def step_text(value: str) -> str:
    """Spell any text in the characters STEP files may hold (ISO 10303-21, 6.4.3).

    Quotes are left to OpenCascade, which doubles them.
    """

    def spell(character: str) -> str:
        if " " <= character <= "~" and character != "\\":
            return character
        code = ord(character)
        return f"\\X2\\{code:04X}\\X0\\" if code <= 0xFFFF else f"\\X4\\{code:08X}\\X0\\"

    return "".join(map(spell, value))


def _with_one_context(content: bytes) -> bytes:
    """The file with one context that all pcurves share: a thirtieth smaller."""
    first = _CONTEXT.search(content)
    if first is None:
        return content
    shared = _PCURVE.sub(rb"\g<1>#" + first[1] + b")", content)
    kept = b"\0"
    once = shared.replace(first[0], kept, 1)
    return _CONTEXT.sub(b"", once).replace(kept, first[0])


def _step_bytes(
    shape: TopoDS_Shape, file_name: str, name: str, header: FileHeader, digits: int
) -> bytes:
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.StepData import StepData_StepWriter
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    label = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(shape, False)
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(step_text(name)))
    writer = STEPCAFControl_Writer()
    if not writer.Transfer(document):
        raise KernelError(f"OpenCascade could not turn {name!r} into STEP entities")
    session = writer.ChangeWriter().WS()
    model = writer.ChangeWriter().Model()
    _set_header(model, file_name, header)
    printer = StepData_StepWriter(model)
    # 17 significant digits name every double; the writer's default is 12 decimals.
    printer.FloatWriter().SetFormat(f"%.{digits - 1}E", True)
    printer.FloatWriter().SetZeroSuppress(digits <= SHORT_DIGITS)
    printer.SendModel(session.NormAdaptor().Protocol())
    # An error in a stream's write ends the process from inside the kernel: only memory is safe
    # to print to.
    buffer = BytesIO()
    if not printer.Print(buffer) or buffer.tell() == 0:
        raise KernelError(f"OpenCascade could not print the STEP entities of {name!r}")
    return buffer.getvalue()


def _set_header(model: Any, file_name: str, header: FileHeader) -> None:
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(step_text(value))

    section = APIHeaderSection_MakeHeader(model)
    section.SetName(text(file_name))
    section.SetTimeStamp(text(time.strftime("%Y-%m-%dT%H:%M:%S+00:00", stamp_time())))
    section.SetAuthorValue(1, text(header.author))
    section.SetOrganizationValue(1, text(header.organisation))
    section.SetAuthorisation(text(header.authorisation))
    kernel = section.PreprocessorVersion().ToCString()
    section.SetPreprocessorVersion(text(f"{program()} with {kernel}"))
    section.SetOriginatingSystem(text(program()))
    section.SetDescriptionValue(1, text(header.description))
    section.Apply(model)
