"""XDE documents of OpenCascade: shapes with names, colours and layers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ffdcli.brep.labels import BodyLabels, ShapeLabels, paint
from ffdcli.errors import KernelError
from ffdcli.labels import Colour

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

Encode = Callable[[str], str]


def bodies_of(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the solids and open shells of a shape, in its order."""
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    if shape.ShapeType() == Kind.TopAbs_COMPOUND:
        return list(_children(shape))
    return [shape]


def faces_of(body: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the faces of a solid or shell, in its order."""
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    shells = _children(body) if body.ShapeType() == Kind.TopAbs_SOLID else [body]
    return [face for shell in shells for face in _children(shell)]


def make_document(
    shape: TopoDS_Shape,
    labels: ShapeLabels,
    encode: Encode,
    *,
    colours: bool = True,
    properties: bool = True,
    millimetres: float = 1.0,
) -> Any:
    """A document of a shape and its labels: one body as a part, several as an assembly.

    Parameters
    ----------
    shape : TopoDS_Shape
    labels : ShapeLabels
        Bodies without labels are numbered.
    encode : callable
        Text in the characters of the file format.
    colours : bool
    properties : bool
        Materials as layers of their names, and mass properties.
    millimetres : float
        Length of the shape's unit: OpenCascade states areas and volumes in millimetres.

    Raises
    ------
    KernelError
        The labels are those of another shape.
    """
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    bodies = bodies_of(shape)
    named = labels.bodies or tuple(
        BodyLabels(labels.name if len(bodies) == 1 else f"{labels.name}-{number + 1}")
        for number in range(len(bodies))
    )
    if len(named) != len(bodies):
        raise KernelError(f"there are labels for {len(named)} bodies, but {len(bodies)} bodies")
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    # A body that stands at a place has no labels of faces of its own: it is a component there.
    placed = any(not body.Location().IsIdentity() for body in bodies)
    root = shapes.NewShape() if len(bodies) > 1 or placed else None
    for where, own in zip(bodies, named, strict=True):
        body = where.Located(TopLoc_Location())
        part = shapes.AddShape(body, False)
        _set_name(part, encode(own.name))
        if root is not None:
            _set_name(shapes.AddComponent(root, part, where.Location()), encode(own.name))
        faces = _Faces(shapes, part, body)
        for number, name in enumerate(own.faces):
            if name:
                _set_name(faces[number], encode(name))
        if colours:
            _set_colours(document, part, faces, *paint(labels, own))
        if properties:
            _set_layers(document, part, faces, labels, own, encode)
            _set_mass(part, own, millimetres)
    if root is not None:
        _set_name(root, encode(labels.name))
        shapes.UpdateAssemblies()
    return document


class _Faces:
    """Labels of a body's faces, made on first use."""

    def __init__(self, shapes: Any, part: Any, body: TopoDS_Shape) -> None:
        self._shapes, self._part, self._body = shapes, part, body
        self._made: dict[int, Any] = {}

    @cached_property
    def _faces(self) -> list[TopoDS_Shape]:
        return faces_of(self._body)

    def __getitem__(self, number: int) -> Any:
        if number not in self._made:
            if number >= len(self._faces):
                raise KernelError(f"there are labels for more than {len(self._faces)} faces")
            self._made[number] = self._shapes.AddSubShape(self._part, self._faces[number])
        return self._made[number]


def _set_colours(
    document: Any, part: Any, faces: _Faces, whole: Colour | None, others: tuple[Colour | None, ...]
) -> None:
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    tool = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    kind, surface = Quantity_TypeOfColor.Quantity_TOC_sRGB, XCAFDoc_ColorType.XCAFDoc_ColorSurf
    if whole is not None:
        tool.SetColor(part, Quantity_Color(*whole, kind), surface)
    for number, colour in enumerate(others):
        if colour is not None:
            tool.SetColor(faces[number], Quantity_Color(*colour, kind), surface)


def _set_layers(
    document: Any, part: Any, faces: _Faces, labels: ShapeLabels, own: BodyLabels, encode: Encode
) -> None:
    """Put the body, or each face, on the layer of its material."""
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    tool = XCAFDoc_DocumentTool.LayerTool_s(document.Main())
    layers = [TCollection_ExtendedString(encode(each.name)) for each in labels.materials]
    if len(set(own.materials)) == 1 and own.materials[0] >= 0:
        tool.SetLayer(part, layers[own.materials[0]])
        return
    for number, material in enumerate(own.materials):
        if material >= 0:
            tool.SetLayer(faces[number], layers[material])


def _set_name(label: Any, name: str) -> None:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name

    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))


def _set_mass(label: Any, own: BodyLabels, millimetres: float) -> None:
    """Set the geometric validation properties (CAx-IF), by which receivers check an import.

    The centroid stays in the unit of the shape, as all points do.
    """
    from OCP.gp import gp_Pnt
    from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_Volume

    if own.mass is not None:
        XCAFDoc_Volume.Set_s(label, own.mass.volume * millimetres**3)
        XCAFDoc_Area.Set_s(label, own.mass.area * millimetres**2)
        XCAFDoc_Centroid.Set_s(label, gp_Pnt(*own.mass.centroid))


def _children(shape: TopoDS_Shape) -> Iterator[Any]:
    from OCP.TopoDS import TopoDS_Iterator

    iterator = TopoDS_Iterator(shape)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()
