"""Shapes as IGES files in full double precision."""

from __future__ import annotations

import re
import textwrap
import time
import unicodedata
from decimal import ROUND_CEILING, Context
from io import BytesIO
from typing import TYPE_CHECKING, Any

from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel, tolerance_settings
from ffdcli.brep.occ.writing.document import bodies_of, faces_of, make_document
from ffdcli.brep.occ.writing.header import FileHeader, program, stamp_time
from ffdcli.brep.occ.writing.shared import iges_faces, share_iges_surfaces
from ffdcli.errors import KernelError
from ffdcli.labels import plain_text
from ffdcli.messages import counted
from ffdcli.units import Unit, unit_named

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# OpenCascade's names of the modes.
_MODES = {"faces": "Faces", "brep": "BRep"}
# Characters of an entity's short label.
_SHORT = 8
# Characters of a text in the global section: OpenCascade's reader holds some 2,000 in all.
_LONGEST = 200
# What OpenCascade takes for a length that it must not print again.
_LENGTH = re.compile(r"\s*[+-]?\d+H")
# Characters of a name in a warning.
_SHOWN = 40
# Characters of text in a line of the start section.
_LINE = 72
# Lines are 80 characters and an end of line; their numbers have seven digits.
_LINE_BYTES = 81
_MOST_LINES = 9_999_999


def iges_bytes(
    shape: TopoDS_Shape,
    file_name: str,
    *,
    unit: str = "mm",
    mode: str = "brep",
    labels: ShapeLabels | None = None,
    header: FileHeader | None = None,
) -> memoryview:
    """The content of an IGES 5.3 file.

    The same shape gives the same bytes except for the time stamp, which ``SOURCE_DATE_EPOCH`` sets.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    file_name : str
        For the header.
    unit : str
        The unit the numbers are in, for the header; see ``units.UNITS``.
    mode : {"brep", "faces"}
        Solids and shells (entities 186 and 514), which keep the edges that faces share; or trimmed
        surfaces (144), which every reader knows, each with edges of its own. Trimmed surfaces have
        no orientation: those of reversed faces are turned, u running backwards.
    labels : ShapeLabels, optional
        Names (property 406, form 15) and colours (314); the materials' layers are numbers only, and
        mass properties have no place. Characters beyond ASCII lose their accents or become ``?``.
    header : FileHeader, optional

    Raises
    ------
    KernelError
        An unknown unit or mode, or OpenCascade failed.
    """
    if mode not in _MODES:
        raise KernelError(f"there is no IGES mode {mode!r}", hint=f"use one of {', '.join(_MODES)}")
    length = unit_named(unit)
    settings = {
        "write.iges.brep.mode": _MODES[mode],
        # Numbers are left unscaled only if it agrees with the header.
        "xstep.cascade.unit": length.kernel,
        **tolerance_settings(shape),
    }
    with silent_kernel(), exchange_settings(settings):
        return _iges_bytes(
            shape, length, file_name, mode, labels or ShapeLabels(), header or FileHeader()
        )


def _iges_bytes(
    shape: TopoDS_Shape,
    unit: Unit,
    file_name: str,
    mode: str,
    labels: ShapeLabels,
    header: FileHeader,
) -> memoryview:
    from OCP.IGESCAFControl import IGESCAFControl_Writer
    from OCP.IGESData import IGESData_IGESWriter
    from OCP.IGESSelect import IGESSelect_WorkLibrary

    writer = IGESCAFControl_Writer()
    # Its own names have a random order.
    writer.SetNameMode(False)
    model = writer.Model()
    _set_header(model, unit, file_name, labels.name, header)
    if not writer.Transfer(make_document(shape, labels, iges_text)):
        raise KernelError(f"OpenCascade could not turn {labels.name!r} into IGES entities")
    writer.ComputeModel()
    share_iges_surfaces(model, shape, solids=mode == "brep")
    _set_names(model, shape, labels)
    section = model.GlobalSection()
    section.SetResolution(_rounded_up(section.Resolution()))
    model.SetGlobalSection(section)
    printer = IGESData_IGESWriter(model)
    # 17 significant digits name every double; the writer's default is ten.
    printer.FloatWriter().SetFormat("%.16E", True)
    printer.FloatWriter().SetZeroSuppress(False)
    printer.SendModel(IGESSelect_WorkLibrary.DefineProtocol_s())
    # An error in a stream's write ends the process inside OpenCascade: only memory is safe.
    buffer = BytesIO()
    if not printer.Print(buffer) or buffer.tell() == 0:
        raise KernelError(f"OpenCascade could not print the IGES entities of {labels.name!r}")
    if buffer.tell() > _MOST_LINES * _LINE_BYTES:
        raise KernelError(
            f"the model is too large for IGES: it would take {buffer.tell() // _LINE_BYTES} lines,"
            f" and no more than {_MOST_LINES} can be numbered",
            hint="write STEP, or a coarser mesh",
        )
    return buffer.getbuffer()


def _set_names(model: Any, shape: TopoDS_Shape, labels: ShapeLabels) -> None:
    """Name the entities of bodies and faces: in full, and the first characters as a label.

    The model keeps the order of the shape. If there are several bodies, the first entity is a
    group.
    """
    from OCP.IGESBasic import IGESBasic_Name
    from OCP.TCollection import TCollection_HAsciiString

    whole, count = model.Entity(1), len(labels.bodies)
    bodies = [whole] if count == 1 else [whole.Entity(i + 1) for i in range(count)]
    named = list(zip(bodies, (body.name for body in labels.bodies), strict=True))
    if count > 1:
        named.append((whole, labels.name))
    if any(body.faces for body in labels.bodies):
        names: list[str] = []
        for body, own in zip(bodies_of(shape), labels.bodies, strict=True):
            names += own.faces or [""] * len(faces_of(body))
        named += zip(iges_faces(model), names, strict=True)
    for entity, name in named:
        if not name:
            continue
        text = iges_text(name)
        entity.SetLabel(TCollection_HAsciiString(text[:_SHORT]))
        full = IGESBasic_Name()
        full.Init(1, TCollection_HAsciiString(text))
        model.AddEntity(full)
        entity.AddProperty(full)


def _set_header(model: Any, unit: Unit, file_name: str, name: str, header: FileHeader) -> None:
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        plain = iges_text(value)[:_LONGEST]
        return TCollection_HAsciiString(f"_{plain}" if _LENGTH.match(plain) else plain)

    for line in textwrap.wrap(iges_text(header.description), _LINE):
        model.AddStartLine(line)
    moment = text(time.strftime("%Y%m%d.%H%M%S", stamp_time()))
    section = model.GlobalSection()
    kernel = section.InterfaceVersion().ToCString()
    section.SetUnitFlag(unit.iges)
    section.SetUnitName(text(unit.kernel))
    # Numbers are left unscaled only if both units agree.
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
    """Round up to the six digits of headers, so that a tolerance stays valid."""
    return float(Context(prec=6, rounding=ROUND_CEILING).create_decimal_from_float(value))


def iges_text(value: str) -> str:
    """Text in ASCII, as IGES files require."""
    plain = unicodedata.normalize("NFKD", plain_text(value))
    kept = (character for character in plain if not unicodedata.combining(character))
    return "".join(character if " " <= character <= "~" else "?" for character in kept)


def changed_names(labels: ShapeLabels) -> list[str]:
    """A warning of the names of bodies and faces that IGES cannot hold; none if it holds all."""
    names = [name for body in labels.bodies for name in (body.name, *body.faces)]
    new = {name: iges_text(name) for name in [labels.name, *names]}
    changed = [name for name, text in new.items() if text != name]
    if not changed:
        return []
    which = counted(len(changed), "name is", "names are")
    first = f"{plain_text(changed[0], _SHOWN)!r} as {plain_text(new[changed[0]], _SHOWN)!r}"
    return [f"IGES holds ASCII only: {which} written with other characters ({first})"]
