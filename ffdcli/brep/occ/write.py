"""Shapes to STEP files, every number at full double precision."""

from __future__ import annotations

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

SCHEMAS = {"ap203": "AP203", "ap214": "AP214IS", "ap242": "AP242DIS"}


def write_step(
    shape: TopoDS_Shape,
    path: str | Path,
    *,
    unit: str = "mm",
    schema: str = "ap214",
    name: str = "part",
    header: FileHeader | None = None,
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
            content = _step_bytes(shape, Path(path).name, name, header or FileHeader())
        return stream.write(content)


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


def _step_bytes(shape: TopoDS_Shape, file_name: str, name: str, header: FileHeader) -> memoryview:
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
    printer.FloatWriter().SetFormat("%.16E", True)
    printer.FloatWriter().SetZeroSuppress(False)
    printer.SendModel(session.NormAdaptor().Protocol())
    # An error in a stream's write ends the process from inside the kernel: only memory is safe
    # to print to.
    buffer = BytesIO()
    if not printer.Print(buffer) or buffer.tell() == 0:
        raise KernelError(f"OpenCascade could not print the STEP entities of {name!r}")
    return buffer.getbuffer()


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
