"""XDE documents of OpenCascade: opened from bytes, kept as bytes, and walked."""

from __future__ import annotations

import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any

from ffdcli.brep.occ.settings import silent_kernel
from ffdcli.errors import KernelError


def new_document() -> Any:
    """An empty document that can be kept as bytes."""
    from OCP.BinXCAFDrivers import BinXCAFDrivers
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFApp import XCAFApp_Application

    application = XCAFApp_Application.GetApplication_s()
    BinXCAFDrivers.DefineFormat_s(application)
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    application.InitDocument(document)
    document.Open(application)
    return document


def bytes_of(document: Any) -> bytes:
    """The content of a document, all numbers as they are.

    Raises
    ------
    KernelError
        OpenCascade failed.
    """
    from OCP.BinXCAFDrivers import BinXCAFDrivers_DocumentStorageDriver
    from OCP.PCDM import PCDM_StoreStatus

    driver, stream = BinXCAFDrivers_DocumentStorageDriver(), BytesIO()
    with silent_kernel():
        driver.Write(document, stream)
    if driver.GetStoreStatus() != PCDM_StoreStatus.PCDM_SS_OK:
        raise KernelError("OpenCascade could not keep the part in memory")
    return stream.getvalue()


def document_of(content: bytes) -> Any:
    """The document that :func:`bytes_of` has kept.

    Raises
    ------
    KernelError
        OpenCascade failed.
    """
    from OCP.BinXCAFDrivers import BinXCAFDrivers_DocumentRetrievalDriver
    from OCP.PCDM import PCDM_ReaderStatus
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.XCAFApp import XCAFApp_Application

    document, driver = new_document(), BinXCAFDrivers_DocumentRetrievalDriver()
    # The driver does not read from streams of Python.
    with silent_kernel(), tempfile.TemporaryDirectory(prefix="ffd-") as folder:
        path = Path(folder, "part.xbf")
        path.write_bytes(content)
        name = TCollection_ExtendedString(str(path))
        driver.Read(name, document, XCAFApp_Application.GetApplication_s())
    if driver.GetStatus() != PCDM_ReaderStatus.PCDM_RS_OK:
        raise KernelError("OpenCascade could not take the part from memory")
    return document


def shape_tool(document: Any) -> Any:
    """The tool that knows the shapes of a document."""
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    return XCAFDoc_DocumentTool.ShapeTool_s(document.Main())


def roots_of(document: Any) -> list[Any]:
    """Labels of the parts and assemblies that are components of no other."""
    return _labels(shape_tool(document).GetFreeShapes)


def root_shapes(document: Any) -> list[Any]:
    """The shapes of the roots, each with all its components where they stand."""
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    return [XCAFDoc_ShapeTool.GetShape_s(label) for label in roots_of(document)]


def components_of(label: Any) -> list[Any]:
    """Labels of the components of an assembly."""
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    return _labels(lambda found: XCAFDoc_ShapeTool.GetComponents_s(label, found))


def subshapes_of(label: Any) -> list[Any]:
    """Labels of a part's faces, edges and so on that have names, colours or layers."""
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    return _labels(lambda found: XCAFDoc_ShapeTool.GetSubShapes_s(label, found))


def referred(label: Any) -> Any:
    """Label of the part or assembly that a component is an instance of."""
    from OCP.TDF import TDF_Label
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    found = TDF_Label()
    XCAFDoc_ShapeTool.GetReferredShape_s(label, found)
    return found


def entry_of(label: Any) -> str:
    """A label's place in its document, such as ``0:1:1:2``."""
    from OCP.TCollection import TCollection_AsciiString
    from OCP.TDF import TDF_Tool

    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return text.ToCString()


def name_of(label: Any) -> str | None:
    """A label's name; None where it has none."""
    from OCP.TDataStd import TDataStd_Name

    # Asking for an attribute that is not there ends the process.
    if not label.IsAttribute(TDataStd_Name.GetID_s()):
        return None
    found = TDataStd_Name()
    label.FindAttribute(TDataStd_Name.GetID_s(), found)
    return found.Get().ToExtString() or None


def set_name(label: Any, name: str) -> None:
    """Name a label."""
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name

    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name, True))


def named_labels(document: Any) -> list[Any]:
    """All labels of a document that have names."""
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_ChildIterator

    found, iterator = [], TDF_ChildIterator(document.Main(), True)
    while iterator.More():
        label = iterator.Value()
        if label.IsAttribute(TDataStd_Name.GetID_s()):
            found.append(label.Father().FindChild(label.Tag(), False))
        iterator.Next()
    return found


def _labels(fill: Any) -> list[Any]:
    from OCP.TDF import TDF_LabelSequence

    found = TDF_LabelSequence()
    fill(found)
    # Values are references into the sequence, which ends with this function: these are copies.
    values = map(found.Value, range(1, found.Length() + 1))
    return [value.Father().FindChild(value.Tag(), False) for value in values]
