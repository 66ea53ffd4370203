"""OpenCascade's process-wide exchange settings, set within a block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


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
