"""Layers, colours and validation properties of bodies and faces, as entities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.labels import BodyLabels, ShapeLabels, paint
from ffdcli.brep.record import MassProperties
from ffdcli.brep.step.entities import Entities
from ffdcli.brep.step.structure import Product, Structure, add_millimetre
from ffdcli.brep.step.text import real, real_rows, references
from ffdcli.brep.step.topology import BodyEntities, text_of
from ffdcli.labels import Colour


def add_properties(
    entities: Entities,
    bodies: Sequence[BodyEntities],
    labels: ShapeLabels,
    structure: Structure,
    millimetres: float,
) -> None:
    """Add layers of materials' names, geometric validation properties (CAx-IF), and colours.

    Parameters
    ----------
    entities, bodies, labels, structure
    millimetres : float
        Length of the model's unit: areas and volumes are stated in millimetres, as OpenCascade
        states them; centroids in the model's unit.
    """
    _add_layers(entities, bodies, labels)
    for body, named, product in zip(bodies, labels.bodies, structure.bodies, strict=True):
        if named.mass is not None:
            _add_mass(entities, body, named.mass, product, structure.context, millimetres)
    made: dict[Colour, int] = {}
    for body, named in zip(bodies, labels.bodies, strict=True):
        _add_styles(entities, body, labels, named, made, structure.context)


def _add_layers(entities: Entities, bodies: Sequence[BodyEntities], labels: ShapeLabels) -> None:
    """Put each body, or each of its faces, on the layer of its material."""
    members: dict[str, list[Ints]] = {}
    for body, named in zip(bodies, labels.bodies, strict=True):
        material = np.array(named.materials, dtype=np.int64)
        for number in np.unique(material[material >= 0]).tolist():
            whole = bool((material == number).all())
            items = np.array([body.item]) if whole else body.faces[material == number]
            members.setdefault(labels.materials[number].name, []).append(items)
    for name, items in members.items():
        listed = references(np.concatenate(items))
        entities.one(b"PRESENTATION_LAYER_ASSIGNMENT(%s,'visible',(%s))" % (text_of(name), listed))


def _add_mass(
    entities: Entities,
    body: BodyEntities,
    mass: MassProperties,
    product: Product,
    context: int,
    millimetres: float,
) -> None:
    """Add volume, area and centroid of a body, by which receivers check an import."""
    one = entities.one
    aspect = one(b"SHAPE_ASPECT('','',#%d,.F.)" % product.shape)
    shape = one(b"SHAPE_REPRESENTATION('',(#%d),#%d)" % (body.item, context))
    special = one(
        b"PROPERTY_DEFINITION('shape with specific properties','properties for subshape',#%d)"
        % aspect
    )
    one(b"SHAPE_DEFINITION_REPRESENTATION(#%d,#%d)" % (special, shape))
    unit = add_millimetre(entities)
    items = []
    for power, kind, value in (
        (2, b"area", mass.area * millimetres**2),
        (3, b"volume", mass.volume * millimetres**3),
    ):
        element = one(b"DERIVED_UNIT_ELEMENT(#%d,%d.)" % (unit, power))
        derived = one(b"DERIVED_UNIT((#%d))" % element)
        name = b"surface area" if power == 2 else b"volume"
        item = one(
            b"MEASURE_REPRESENTATION_ITEM('%s measure',%s_MEASURE(%s),#%d)"
            % (name, kind.upper(), real(value), derived)
        )
        items.append((name, item))
    (place,) = real_rows(np.array([mass.centroid]))
    items.append((b"centroid", one(b"CARTESIAN_POINT('centre point',(%s))" % place)))
    for name, item in items:
        stated = one(b"REPRESENTATION('%s',(#%d),#%d)" % (name, item, context))
        meant = one(
            b"PROPERTY_DEFINITION('geometric validation property','%s',#%d)" % (name, aspect)
        )
        one(b"PROPERTY_DEFINITION_REPRESENTATION(#%d,#%d)" % (meant, stated))


def _add_styles(
    entities: Entities,
    body: BodyEntities,
    labels: ShapeLabels,
    named: BodyLabels,
    made: dict[Colour, int],
    context: int,
) -> None:
    """Colour a body, and those of its faces that have another colour."""
    whole, colours = paint(labels, named)
    items = []
    template = b"STYLED_ITEM('color',(#%d),#%d)"
    if whole is not None:
        below = entities.one(template % (_style(entities, whole, made), body.item))
        items.append(np.array([below]))
        template = b"OVER_RIDING_STYLED_ITEM('overriding color',(#%%d),#%%d,#%d)" % below
    painted = np.array([place for place, colour in enumerate(colours) if colour is not None], int)
    styles = [_style(entities, colour, made) for colour in colours if colour is not None]
    if styles:
        items.append(entities.add(template, np.array(styles), body.faces[painted]))
    if items:
        entities.one(
            b"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(%s),#%d)"
            % (references(np.concatenate(items)), context)
        )


def _style(entities: Entities, colour: Colour, made: dict[Colour, int]) -> int:
    """The style of a colour, made once."""
    if colour not in made:
        one = entities.one
        rgb = one(b"COLOUR_RGB('',%s)" % real_rows(np.array([colour], dtype=np.float64))[0])
        fill = one(b"FILL_AREA_STYLE_COLOUR('',#%d)" % rgb)
        area = one(b"FILL_AREA_STYLE('',(#%d))" % fill)
        shown = one(b"SURFACE_STYLE_FILL_AREA(#%d)" % area)
        side = one(b"SURFACE_SIDE_STYLE('',(#%d))" % shown)
        usage = one(b"SURFACE_STYLE_USAGE(.BOTH.,#%d)" % side)
        made[colour] = one(b"PRESENTATION_STYLE_ASSIGNMENT((#%d))" % usage)
    return made[colour]
