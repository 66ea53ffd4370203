"""Colours of STEP entities.

OpenCascade's own writer makes the same styles, but in a random order and with seven entities for
every face. Here each colour is made once, and the order is that of the bodies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ffdcli.brep.labels import ShapeLabels, paint
from ffdcli.brep.occ.writing.document import bodies_of, faces_of
from ffdcli.labels import Colour

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


def set_styles(session: Any, shape: TopoDS_Shape, labels: ShapeLabels) -> None:
    """Colour the bodies and faces of a shape that has been turned into STEP entities."""
    from OCP.STEPConstruct import STEPConstruct_Styles
    from OCP.StepRepr import StepRepr_HArray1OfRepresentationItem
    from OCP.StepVisual import StepVisual_MechanicalDesignGeometricPresentationRepresentation

    made: dict[Colour, Any] = {}
    for body, own in zip(bodies_of(shape), labels.bodies, strict=False):
        whole, colours = paint(labels, own)
        if whole is None and not any(colours):
            continue
        styles = STEPConstruct_Styles(session)
        below = None
        if whole is not None:
            below = styles.AddStyle(body, _style(styles, whole, made), None)
            below.SetName(_text("color"))
        for face, colour in zip(faces_of(body), colours, strict=False):
            if colour is not None:
                item = styles.AddStyle(face, _style(styles, colour, made), below)
                item.SetName(_text("color" if below is None else "overriding color"))
        items = StepRepr_HArray1OfRepresentationItem(1, styles.NbStyles())
        for place in range(1, styles.NbStyles() + 1):
            items.SetValue(place, styles.Style(place))
        presentation = StepVisual_MechanicalDesignGeometricPresentationRepresentation()
        presentation.Init(_text(""), items, styles.FindContext(body))
        session.Model().AddWithRefs(presentation)


def _style(styles: Any, colour: Colour, made: dict[Colour, Any]) -> Any:
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor

    if colour not in made:
        kind = Quantity_TypeOfColor.Quantity_TOC_sRGB
        encoded = styles.EncodeColor_s(Quantity_Color(*colour, kind))
        made[colour] = styles.MakeColorPSA(None, encoded, None, None, 0.0)
    return made[colour]


def _text(value: str) -> Any:
    from OCP.TCollection import TCollection_HAsciiString

    return TCollection_HAsciiString(value)
