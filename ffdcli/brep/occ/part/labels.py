"""Names and colours of a document's faces and solids, for every place where they stand."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

from ffdcli.brep.labels import BodyLabels, ShapeLabels
from ffdcli.brep.occ.part.document import (
    components_of,
    name_of,
    referred,
    roots_of,
    subshapes_of,
)
from ffdcli.brep.occ.part.walk import Numbering
from ffdcli.brep.occ.writing.document import faces_of
from ffdcli.labels import Colour, Material

# What STEP writers give for no name.
_NO_NAMES = ("", "NONE", "UNNAMED")


def occurrences(document: Any) -> Iterator[tuple[Any, Any]]:
    """Labels of parts, once for each place where they stand, and the location there."""
    from OCP.TopLoc import TopLoc_Location

    for root in roots_of(document):
        yield from _below(root, TopLoc_Location())


def names_in(document: Any, found: Numbering) -> tuple[tuple[str | None, ...], ...]:
    """The name of each face and of each solid; None where it has none."""
    faces: list[str | None] = [None] * found.faces.Extent()
    solids: list[str | None] = [None] * len(found.solids)
    for label, own_faces, own_solids in _labelled(document, found):
        name = name_of(label)
        if name is None or name.upper() in _NO_NAMES:
            continue
        if len(own_faces) == 1 and not own_solids:
            faces[own_faces[0]] = name
        for number in own_solids:
            solids[number] = name
    return tuple(faces), tuple(solids)


def distinct_names(*names: Iterable[str | None]) -> list[str]:
    """The names that there are, each once, in their order."""
    return [name for name in dict.fromkeys(itertools.chain(*names)) if name is not None]


def colours_in(document: Any, found: Numbering) -> list[Colour | None]:
    """The colour of each face; None where it has none."""
    colours: list[Colour | None] = [None] * found.faces.Extent()
    for label, faces, _ in _labelled(document, found):
        colour = _colour_of(label)
        for number in faces if colour is not None else []:
            colours[number] = colour
    return colours


def body_labels(document: Any, found: Numbering, bodies: list[Any], name: str) -> ShapeLabels:
    """Names and colours of solids and open shells, for formats that know no assemblies."""
    face_names, solid_names = names_in(document, found)
    colours = colours_in(document, found)
    kinds = list(dict.fromkeys(colour for colour in colours if colour is not None))
    out = []
    for number, body in enumerate(bodies):
        own = [found.faces.FindIndex(face) - 1 for face in faces_of(body)]
        title = solid_names[number] if number < len(solid_names) else None
        out.append(
            BodyLabels(
                title or (name if len(bodies) == 1 else f"{name}-{number + 1}"),
                tuple(face_names[face] or "" for face in own),
                tuple(-1 if (c := colours[face]) is None else kinds.index(c) for face in own),
            )
        )
    return ShapeLabels(name, tuple(Material("", colour) for colour in kinds), tuple(out))


def _labelled(document: Any, found: Numbering) -> Iterator[tuple[Any, list[int], list[int]]]:
    """Labels of parts and of what they consist of, with the faces and solids that they stand for.

    What comes later is more particular.
    """
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopTools import TopTools_IndexedMapOfShape
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    solids = TopTools_IndexedMapOfShape()
    for solid in found.solids:
        solids.Add(solid)
    for label, location in occurrences(document):
        for each in (label, *subshapes_of(label)):
            shape = XCAFDoc_ShapeTool.GetShape_s(each).Moved(location)
            yield (
                each,
                _numbers_in(shape, Kind.TopAbs_FACE, found.faces),
                _numbers_in(shape, Kind.TopAbs_SOLID, solids),
            )


def _numbers_in(shape: Any, kind: Any, known: Any) -> list[int]:
    """Numbers of the parts of a kind that a shape has, itself included."""
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    parts = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, parts)
    numbers = (known.FindIndex(parts.FindKey(n)) for n in range(1, parts.Extent() + 1))
    return [number - 1 for number in numbers if number]


def _colour_of(label: Any) -> Colour | None:
    """The colour of a label's surfaces, or its general one; None where it has none."""
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ColorType

    found = Quantity_Color()
    for kind in (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen):
        if XCAFDoc_ColorTool.GetColor_s(label, kind, found):
            red, green, blue = found.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
            return red, green, blue
    return None


def _below(label: Any, location: Any) -> Iterator[tuple[Any, Any]]:
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    if not XCAFDoc_ShapeTool.IsAssembly_s(label):
        yield label, location
        return
    for component in components_of(label):
        place = location.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component))
        yield from _below(referred(component), place)
