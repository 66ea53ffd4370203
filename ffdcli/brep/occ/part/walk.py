"""Faces, edges and vertices of OpenCascade shapes, numbered in one order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


@dataclass
class Numbering:
    """The parts of shapes, each once for every place where it stands.

    Parameters
    ----------
    faces, edges, vertices : TopTools_IndexedMapOfShape
        Numbers start at 1. Orientations do not count, locations do.
    face_reversed : list of bool
        Whether the outward normal is opposite to the surface's.
    face_shell : list of int
    shells : list of (TopoDS_Shape or None, int)
        Shells, None for faces outside of shells, and their solids; -1 for none.
    solids : list of TopoDS_Shape
    """

    faces: Any
    edges: Any
    vertices: Any
    face_reversed: list[bool] = field(default_factory=list)
    face_shell: list[int] = field(default_factory=list)
    shells: list[tuple[Any, int]] = field(default_factory=list)
    solids: list[Any] = field(default_factory=list)


def number_parts(shapes: list[TopoDS_Shape]) -> Numbering:
    """Number the faces, edges and vertices of shapes; loose edges and vertices are left out."""
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    found = Numbering(*(TopTools_IndexedMapOfShape() for _ in range(3)))
    for shape in shapes:
        _walk(shape, found, -1)
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    for number in range(1, found.faces.Extent() + 1):
        face = found.faces.FindKey(number)
        TopExp.MapShapes_s(face, Kind.TopAbs_EDGE, found.edges)
        TopExp.MapShapes_s(face, Kind.TopAbs_VERTEX, found.vertices)
    return found


def face_uses(found: Numbering) -> int:
    """Number of faces, counted once for every shell that has them."""
    return sum(1 if shell is None else len(list(children(shell))) for shell, _ in found.shells)


def unshared(shapes: list[TopoDS_Shape]) -> list[Any]:
    """Shapes of which no two share a face: solids of their own where solids share faces."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    found = number_parts(shapes)
    if face_uses(found) == found.faces.Extent():
        return shapes
    bodies, known = [], set()
    for number, (shell, solid) in enumerate(found.shells):
        if solid >= 0 and solid not in known:
            known.add(solid)
            bodies.append(BRepBuilderAPI_Copy(found.solids[solid], False, False).Shape())
        elif solid < 0 and shell is not None:
            bodies.append(BRepBuilderAPI_Copy(shell, False, False).Shape())
        elif solid < 0 and number in found.face_shell:
            bodies.append(found.faces.FindKey(found.face_shell.index(number) + 1))
    return bodies


def children(shape: TopoDS_Shape) -> Iterator[Any]:
    """Parts of a shape, with orientation and location as they stand."""
    from OCP.TopoDS import TopoDS_Iterator

    iterator = TopoDS_Iterator(shape)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()


def is_reversed(shape: TopoDS_Shape) -> bool:
    """Whether a shape is reversed."""
    from OCP.TopAbs import TopAbs_Orientation

    return bool(shape.Orientation() == TopAbs_Orientation.TopAbs_REVERSED)


def _walk(shape: Any, found: Numbering, solid: int) -> None:
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    kind = shape.ShapeType()
    if kind == Kind.TopAbs_FACE:
        _add_faces(found, None, [shape], -1)
    elif kind == Kind.TopAbs_SHELL:
        _add_faces(found, shape, list(children(shape)), solid)
    elif kind == Kind.TopAbs_SOLID:
        found.solids.append(shape)
        number = len(found.solids) - 1
        for child in children(shape):
            _walk(child, found, number)
    elif kind in (Kind.TopAbs_COMPOUND, Kind.TopAbs_COMPSOLID):
        for child in children(shape):
            _walk(child, found, -1)


def _add_faces(found: Numbering, shell: Any, faces: list[Any], solid: int) -> None:
    found.shells.append((shell, solid))
    for face in faces:
        before = found.faces.Extent()
        if found.faces.Add(face) > before:
            found.face_reversed.append(is_reversed(face))
            found.face_shell.append(len(found.shells) - 1)
