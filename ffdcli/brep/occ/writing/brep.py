"""Shapes as OpenCascade's own text files (.brep) in full double precision."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

from ffdcli.brep.occ.settings import silent_kernel
from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Header of the section with vertices, edges, faces and so on.
_TOPOLOGY = b"\nTShapes "


def brep_bytes(shape: TopoDS_Shape) -> bytes:
    """The content of a .brep file; the same shape gives the same bytes.

    Such files state no unit. Tolerances have 15 digits.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.

    Raises
    ------
    KernelError
        There is no shape, or OpenCascade failed.
    """
    from OCP.BRepTools import BRepTools
    from OCP.TopTools import TopTools_FormatVersion

    if shape.IsNull():
        raise KernelError("there is no shape to write")
    buffer = BytesIO()
    version = TopTools_FormatVersion.TopTools_FormatVersion_VERSION_1
    with silent_kernel():
        BRepTools.Write_s(shape, buffer, False, False, version)
        geometry, mark, topology = buffer.getvalue().rpartition(_TOPOLOGY)
        if not mark:
            raise KernelError("OpenCascade could not print the shape")
        return geometry + mark + _with_all_digits(shape, topology)


def _with_all_digits(shape: TopoDS_Shape, topology: bytes) -> bytes:
    """The topology with 17 digits for vertices and ranges of edges.

    OpenCascade prints curves and surfaces with 17 digits, but these with 15.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepTools import BRepTools_ShapeSet
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopoDS import TopoDS

    # The same shapes in the order of the file.
    shapes = BRepTools_ShapeSet(False, False)
    shapes.Add(shape)
    listed = map(shapes.Shape, range(1, shapes.NbShapes() + 1))
    wanted = (each for each in listed if each.ShapeType() in (Kind.TopAbs_VERTEX, Kind.TopAbs_EDGE))
    lines = topology.split(b"\n")
    for number, line in enumerate(lines):
        # The kind and a line with the tolerance and flags precede the point of a vertex, or the
        # curve of an edge: kind 1, number, location, first and last parameter.
        if line == b"Ve":
            values = BRep_Tool.Pnt_s(TopoDS.Vertex_s(next(wanted))).Coord()
            lines[number + 2] = b"%.17g %.17g %.17g" % values
        elif line == b"Ed":
            values = BRep_Tool.Range_s(TopoDS.Edge_s(next(wanted)))
            fields = lines[number + 2].split()
            if fields[0] == b"1":
                lines[number + 2] = b" ".join([*fields[:3], b"%.17g %.17g" % values])
    return b"\n".join(lines)
