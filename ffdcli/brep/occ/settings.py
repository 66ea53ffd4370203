"""OpenCascade's process-wide settings and messages, changed within a block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


@contextmanager
def silent_kernel() -> Iterator[None]:
    """Remove OpenCascade's message printers within the block.

    All messages go through its default messenger, so file descriptors stay untouched and Python's
    own output passes. The printers are restored afterwards.
    """
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    printers = messenger.ChangePrinters()
    kept = [printers.Value(i) for i in range(1, printers.Size() + 1)]
    printers.Clear()
    try:
        yield
    finally:
        for printer in kept:
            messenger.AddPrinter(printer)


@contextmanager
def exchange_settings(values: Mapping[str, str]) -> Iterator[None]:
    """Set exchange parameters, and restore the old values afterwards.

    Parameters
    ----------
    values : mapping of str to str
        Names and values, as OpenCascade spells them.

    Raises
    ------
    KernelError
        A name or value is unknown to this OpenCascade.
    """
    from OCP.IGESControl import IGESControl_Controller
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Controller

    # Values set before the controllers exist are silently ignored.
    STEPCAFControl_Controller.Init_s()
    IGESControl_Controller.Init_s()
    before = {name: Interface_Static.CVal_s(name) for name in values}
    try:
        for name, value in values.items():
            if not Interface_Static.SetCVal_s(name, value):
                raise KernelError(f"OpenCascade refused to set {name} to {value}")
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)


def tolerance_settings(shape: TopoDS_Shape) -> dict[str, str]:
    """Settings that make a file state its largest tolerance.

    STEP and IGES files have one tolerance for all edges, which must be the largest. By default
    OpenCascade rounds it, also downwards, and edges then fail when the file is read.

    Raises
    ------
    KernelError
        There is no shape.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    if shape.IsNull():
        raise KernelError("there is no shape to write")
    kinds = (Kind.TopAbs_FACE, Kind.TopAbs_EDGE, Kind.TopAbs_VERTEX)
    largest = max(BRep_Tool.MaxTolerance_s(shape, kind) for kind in kinds)
    return {"write.precision.mode": "User", "write.precision.val": repr(largest)}
