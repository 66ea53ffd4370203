"""OpenCascade shapes built from boundary representations, without sewing, fitting or repair."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

from ffdcli.errors import KernelError, lacks_memory

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from ffdcli.brep.record import Brep


def build_shape(brep: Brep) -> TopoDS_Shape:
    """The shape of a boundary representation, with shared vertices and edges.

    A straight edge between planes becomes a line with its length as parameter; every other edge
    keeps its B-spline curve on [0, 1] with straight pcurves of the same parameter.

    Parameters
    ----------
    brep : Brep
        All lengths are taken as they are.

    Returns
    -------
    TopoDS_Shape
        The solid or open shell, or a compound of them where there are several.

    Raises
    ------
    KernelError
        OpenCascade refused something; the message says what it was asked to make.
    """
    from ffdcli.brep.occ.building.stream import write_stream

    stream = BytesIO()
    write_stream(brep, stream)
    stream.seek(0)
    return shape_of_stream(stream)


def shape_of_stream(stream: BytesIO) -> TopoDS_Shape:
    """Read a shape from its binary stream; see :mod:`ffdcli.brep.occ.building.stream`.

    Raises
    ------
    KernelError
        This OpenCascade does not know the stream's format, or refused what is in it.
    """
    from OCP.BinTools import BinTools, BinTools_FormatVersion
    from OCP.TopoDS import TopoDS_Shape

    if not hasattr(BinTools_FormatVersion, "BinTools_FormatVersion_VERSION_4"):
        raise KernelError(
            "this OpenCascade does not read version 4 of its binary format",
            hint="install cadquery 2.8 or newer",
        )
    shape = TopoDS_Shape()
    try:
        BinTools.Read_s(shape, stream)
    except Exception as error:
        if lacks_memory(error):
            raise
        reason = str(error).strip() or type(error).__name__
        raise KernelError(f"OpenCascade refused to make the shape: {reason}") from error
    if shape.IsNull():
        raise KernelError("OpenCascade made no shape of the stream it was given")
    return shape


def as_cadquery(shape: TopoDS_Shape) -> Any:
    """Wrap a kernel shape as cadquery's own kind: ``Solid``, ``Shell`` or ``Compound``."""
    from cadquery import Shape

    return Shape.cast(shape)
