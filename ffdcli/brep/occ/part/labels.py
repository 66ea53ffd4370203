"""Names of a document's faces and solids, for every place where they stand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ffdcli.brep.occ.part.document import (
    components_of,
    name_of,
    referred,
    roots_of,
    subshapes_of,
)
from ffdcli.brep.occ.part.walk import Numbering, children

# What STEP writers give for no name.
_NO_NAMES = ("", "NONE", "UNNAMED")


def occurrences(document: Any) -> Iterator[tuple[Any, Any]]:
    """Labels of parts, once for each place where they stand, and the location there."""
    from OCP.TopLoc import TopLoc_Location

    for root in roots_of(document):
        yield from _below(root, TopLoc_Location())


def names_in(document: Any, found: Numbering) -> tuple[tuple[str | None, ...], ...]:
    """The name of each face and of each solid; None where it has none."""
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    faces: list[str | None] = [None] * found.faces.Extent()
    solids: list[str | None] = [None] * len(found.solids)
    for label, location in occurrences(document):
        named = [(sub, name_of(sub)) for sub in subshapes_of(label)]
        for sub, name in [(label, name_of(label)), *named]:
            if name is None or name.upper() in _NO_NAMES:
                continue
            shape = XCAFDoc_ShapeTool.GetShape_s(sub).Moved(location)
            if shape.ShapeType() == Kind.TopAbs_FACE:
                place = found.faces.FindIndex(shape)
                if place:
                    faces[place - 1] = name
            for solid in _solids_of(shape):
                for number, other in enumerate(found.solids):
                    if other.IsSame(solid):
                        solids[number] = name
    return tuple(faces), tuple(solids)


def _below(label: Any, location: Any) -> Iterator[tuple[Any, Any]]:
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    if not XCAFDoc_ShapeTool.IsAssembly_s(label):
        yield label, location
        return
    for component in components_of(label):
        place = location.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component))
        yield from _below(referred(component), place)


def _solids_of(shape: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    if shape.ShapeType() == Kind.TopAbs_SOLID:
        return [shape]
    if shape.ShapeType() in (Kind.TopAbs_COMPOUND, Kind.TopAbs_COMPSOLID):
        return [solid for child in children(shape) for solid in _solids_of(child)]
    return []
