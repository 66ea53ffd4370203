"""Shapes as STEP files, in full double precision or with fewer digits on request."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Any

from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.entities import entities
from ffdcli.brep.occ.formats import UNPAINTED
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel, tolerance_settings
from ffdcli.brep.occ.writing.document import bodies_of, make_document
from ffdcli.brep.occ.writing.header import FileHeader, program, stamp_time
from ffdcli.brep.occ.writing.print_step import print_entities
from ffdcli.brep.occ.writing.shared import share_step_surfaces
from ffdcli.brep.occ.writing.step_texts import StepTexts
from ffdcli.brep.occ.writing.styles import set_styles
from ffdcli.errors import KernelError
from ffdcli.units import Unit, unit_named

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Most digits for which OpenCascade can omit trailing zeros: it searches the exponent in the first
# 16 characters.
SHORT_DIGITS = 13
# Each pcurve has a context; all are equal.
_CONTEXT = re.compile(
    rb"#(\d+) = \( GEOMETRIC_REPRESENTATION_CONTEXT\(2\)\s+"
    rb"PARAMETRIC_REPRESENTATION_CONTEXT\(\)\s+REPRESENTATION_CONTEXT\('2D SPACE',''\s*\) \);\n"
)
_PCURVE = re.compile(rb"(= DEFINITIONAL_REPRESENTATION\('',\s*\(#\d+\),\s*)#\d+\)")

# OpenCascade's names of the schemas.
SCHEMAS = {"ap203": "AP203", "ap214": "AP214IS", "ap242": "AP242DIS"}


def step_bytes(
    shape: TopoDS_Shape,
    file_name: str,
    *,
    unit: str = "mm",
    schema: str = "ap214",
    pcurves: bool = True,
    labels: ShapeLabels | None = None,
    header: FileHeader | None = None,
    digits: int = 17,
    processes: int = 1,
) -> bytes:
    """The content of a STEP file.

    The same shape gives the same bytes except for the time stamp, which ``SOURCE_DATE_EPOCH``
    sets. Several bodies are the parts of an assembly.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    file_name : str
        For the header.
    unit : str
        The unit the numbers are in, for the header; see ``units.UNITS``.
    schema : {"ap203", "ap214", "ap242"}
        AP203 has no place for colours, layers and mass properties.
    pcurves : bool
        Give edges their curves in the parameters of their faces too.
    labels : ShapeLabels, optional
        Names, colours, layers (one for each material) and mass properties (geometric validation
        properties, as the CAx-IF recommends them).
    header : FileHeader, optional
    digits : int
        Significant digits; 17 name every double. Up to 13, what can be left out to make the file
        smaller is left out: trailing zeros, and all but one of the equal contexts.
    processes : int
        How many may print at once.

    Raises
    ------
    KernelError
        An unknown unit or schema, or OpenCascade failed.
    """
    if schema not in SCHEMAS:
        raise KernelError(
            f"there is no STEP schema {schema!r}", hint=f"use one of {', '.join(SCHEMAS)}"
        )
    length = unit_named(unit)
    settings = {**step_settings(length, schema, pcurves=pcurves), **tolerance_settings(shape)}
    with silent_kernel(), exchange_settings(settings):
        content = _step_bytes(
            shape,
            file_name,
            labels or ShapeLabels(),
            header or FileHeader(),
            schema,
            length,
            digits,
            processes,
        )
    return _with_one_context(content) if digits <= SHORT_DIGITS else content


def step_settings(unit: Unit, schema: str, *, pcurves: bool) -> dict[str, str]:
    """Settings of OpenCascade's STEP writer."""
    return {
        "write.step.schema": SCHEMAS[schema],
        # Numbers are left unscaled only if both units agree.
        "write.step.unit": unit.kernel,
        "xstep.cascade.unit": unit.kernel,
        "write.surfacecurve.mode": "On" if pcurves else "Off",
        "write.stepcaf.subshapes.name": "1",
    }


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
    shape: TopoDS_Shape,
    file_name: str,
    labels: ShapeLabels,
    header: FileHeader,
    schema: str,
    unit: Unit,
    digits: int,
    processes: int,
) -> bytes:
    painted, texts = schema not in UNPAINTED, StepTexts()
    document = make_document(
        shape, labels, texts, colours=False, properties=painted, millimetres=unit.millimetres
    )
    writer = transfer_document(document, labels.name, colours=False)
    session = writer.WS()
    bodies = bodies_of(shape)
    if len(bodies) == 1 and labels.bodies:
        _name_item(session, bodies[0], texts(labels.bodies[0].name))
    if painted:
        set_styles(session, shape, labels)
    share_step_surfaces(session, shape)
    return print_document(
        writer, file_name, header, texts, schema=schema, digits=digits, processes=processes
    )


def transfer_document(document: Any, name: str, *, colours: bool) -> Any:
    """The STEP writer that holds the entities of a document.

    Raises
    ------
    KernelError
        OpenCascade failed.
    """
    from OCP.STEPCAFControl import STEPCAFControl_Writer

    writer = STEPCAFControl_Writer()
    writer.SetColorMode(colours)
    if not writer.Transfer(document):
        raise KernelError(f"OpenCascade could not turn {name!r} into STEP entities")
    return writer.ChangeWriter()


def print_document(
    writer: Any,
    file_name: str,
    header: FileHeader,
    texts: StepTexts,
    *,
    schema: str,
    digits: int,
    processes: int,
) -> bytes:
    """Print the entities of a STEP writer, after header, people and dates are set."""
    session, model = writer.WS(), writer.Model()
    _number_occurrences(model)
    _set_header(model, file_name, header, texts)
    if schema in UNPAINTED:
        _set_people_and_dates(model, header, texts)
    protocol = session.NormAdaptor().Protocol()
    short = digits <= SHORT_DIGITS
    printed = print_entities(model, protocol, digits, short=short, processes=processes)
    return texts.put_into(printed)


def _name_item(session: Any, body: TopoDS_Shape, name: str) -> None:
    """Name the entity of a body, which OpenCascade does in assemblies only."""
    from OCP.STEPConstruct import STEPConstruct
    from OCP.TCollection import TCollection_HAsciiString

    found = STEPConstruct.FindEntity_s(session.TransferWriter().FinderProcess(), body)
    if found is not None:
        found.SetName(TCollection_HAsciiString(name))


def _number_occurrences(model: Any) -> None:
    """Number the parts of an assembly from 1; OpenCascade continues from file to file."""
    from OCP.StepRepr import StepRepr_NextAssemblyUsageOccurrence
    from OCP.TCollection import TCollection_HAsciiString

    for number, each in enumerate(entities(model, StepRepr_NextAssemblyUsageOccurrence)):
        each.SetId(TCollection_HAsciiString(str(number + 1)))


def _set_people_and_dates(model: Any, header: FileHeader, texts: StepTexts) -> None:
    """Set the people and dates that AP203 requires from the header's author and time.

    By default OpenCascade writes the names of machine and user, and the local time.
    """
    from OCP.StepBasic import (
        StepBasic_CalendarDate,
        StepBasic_LocalTime,
        StepBasic_Organization,
        StepBasic_Person,
    )
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(texts(value))

    author, now = header.author or "unknown", stamp_time()
    for person in entities(model, StepBasic_Person):
        person.SetId(text(author))
        person.SetLastName(text(author))
        person.SetFirstName(text(""))
    for organisation in entities(model, StepBasic_Organization):
        organisation.SetId(text(""))
        organisation.SetName(text(header.organisation or "unknown"))
    for date in entities(model, StepBasic_CalendarDate):
        date.SetYearComponent(now.tm_year)
        date.SetMonthComponent(now.tm_mon)
        date.SetDayComponent(now.tm_mday)
    for moment in entities(model, StepBasic_LocalTime):
        moment.SetHourComponent(now.tm_hour)
        moment.SetMinuteComponent(now.tm_min)


def _set_header(model: Any, file_name: str, header: FileHeader, texts: StepTexts) -> None:
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(texts(value))

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
