"""Triangles of a shape for pictures, by OpenCascade's mesher."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

_ANGLE = 0.15


@dataclass(frozen=True)
class ShapeTriangles:
    """Triangles of a shape's faces.

    Parameters
    ----------
    points : (n, 3) float64, model length
        Faces do not share points; on a shared edge those of its faces are equal.
    triangles : (T, 3) int64
        Counter-clockwise seen from outside.
    face : (T,) int64
        In the order of the shape.
    surfaces : tuple of str
        Kind of each face: its degrees, lower × higher, or a word such as ``plane``.
    """

    points: Floats
    triangles: Ints
    face: Ints
    surfaces: tuple[str, ...]


def triangulate(shape: TopoDS_Shape, share: float) -> ShapeTriangles:
    """Triangulate the faces of a shape.

    Parameters
    ----------
    shape : TopoDS_Shape
    share : float
        Largest distance from the surfaces, as a share of the diagonal of the shape's box.

    Raises
    ------
    KernelError
        The shape has no face that OpenCascade can triangulate.
    """
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Tool
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    if box.IsVoid():
        raise KernelError("the file holds no faces to draw")
    BRepMesh_IncrementalMesh(shape, share * box.SquareExtent() ** 0.5, False, _ANGLE, True)
    points: list[Floats] = []
    triangles: list[Ints] = []
    faces: list[Ints] = []
    surfaces: list[str] = []
    count = 0
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        face = TopoDS.Face_s(explorer.Current())
        explorer.Next()
        number = len(surfaces)
        surfaces.append(_kind(face))
        place = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, place)
        if mesh is None:
            continue
        moved = place.Transformation()
        nodes = (mesh.Node(i).Transformed(moved) for i in range(1, mesh.NbNodes() + 1))
        own = np.array([(node.X(), node.Y(), node.Z()) for node in nodes])
        corners = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            corners = corners[:, ::-1]
        points.append(own)
        triangles.append(corners + count)
        faces.append(np.full(len(corners), number))
        count += len(own)
    if not points:
        raise KernelError("the file holds no faces that OpenCascade can draw")
    return ShapeTriangles(
        np.concatenate(points), np.concatenate(triangles), np.concatenate(faces), tuple(surfaces)
    )


def _kind(face: Any) -> str:
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    surface = BRepAdaptor_Surface(face, False)
    kind = surface.GetType()
    if kind in (
        GeomAbs_SurfaceType.GeomAbs_BSplineSurface,
        GeomAbs_SurfaceType.GeomAbs_BezierSurface,
    ):
        low, high = sorted((surface.UDegree(), surface.VDegree()))
        return f"{low}x{high}"
    return str(kind.name).removeprefix("GeomAbs_").lower()
