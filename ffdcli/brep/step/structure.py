"""Products, contexts, units and, for AP203, people and dates, as entities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.writing.header import FileHeader, stamp_time
from ffdcli.brep.step.entities import Entities
from ffdcli.brep.step.text import real
from ffdcli.brep.step.topology import BodyEntities, text_of
from ffdcli.units import Unit

# Prefixes of SI units by their length in millimetres; other units are multiples of a millimetre.
_PREFIXES = {1.0: b".MILLI.", 10.0: b".CENTI.", 1000.0: b"$", 1e6: b".KILO.", 1e-3: b".MICRO."}
_NO_TEXT = b"''"


@dataclass(frozen=True)
class Protocol:
    """What a schema calls things.

    Parameters
    ----------
    schema, name, context : bytes
    year : int
    formation, formation_end, mechanical, design, category : bytes
        Kinds of entities, and the category of products.
    """

    schema: bytes
    name: bytes
    year: int
    context: bytes
    formation: bytes = b"PRODUCT_DEFINITION_FORMATION"
    formation_end: bytes = b""
    mechanical: bytes = b"PRODUCT_CONTEXT"
    design: bytes = b"PRODUCT_DEFINITION_CONTEXT('part definition'"
    category: bytes = b"part"

    @property
    def has_people(self) -> bool:
        """Whether products need people and dates: in AP203 alone."""
        return self.name == b"config_control_design"


PROTOCOLS = {
    "ap203": Protocol(
        b"CONFIG_CONTROL_DESIGN",
        b"config_control_design",
        1994,
        b"configuration controlled 3D designs of mechanical parts and assemblies",
        b"PRODUCT_DEFINITION_FORMATION_WITH_SPECIFIED_SOURCE",
        b",.NOT_KNOWN.",
        b"MECHANICAL_CONTEXT",
        b"DESIGN_CONTEXT(''",
        b"detail",
    ),
    "ap214": Protocol(
        b"AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
        b"automotive_design",
        2000,
        b"core data for automotive mechanical design processes",
    ),
    "ap242": Protocol(
        b"AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {1 0 10303 442 1 1 4 }",
        b"ap242_managed_model_based_3d_engineering",
        2013,
        b"Managed model based 3d engineering",
    ),
}


@dataclass(frozen=True)
class Product:
    """Entities of a product: itself, its formation, definition and shape."""

    product: int
    formation: int
    definition: int
    shape: int


@dataclass(frozen=True)
class Structure:
    """Entities that properties and styles refer to: the context, and each body's product."""

    context: int
    bodies: tuple[Product, ...]


def add_structure(
    entities: Entities,
    bodies: Sequence[BodyEntities],
    labels: ShapeLabels,
    schema: str,
    unit: Unit,
    tolerance: float,
    header: FileHeader,
) -> Structure:
    """Add the products: one body is a part, several are the parts of an assembly.

    Parameters
    ----------
    entities : Entities
    bodies : sequence of BodyEntities
    labels : ShapeLabels
    schema : {"ap203", "ap214", "ap242"}
    unit : Unit
    tolerance : float, model length
        Largest of all edges and vertices.
    header : FileHeader
        For the people of AP203.
    """
    protocol = PROTOCOLS[schema]
    context = _add_context(entities, unit, tolerance)
    application = entities.one(b"APPLICATION_CONTEXT('%s')" % protocol.context)
    entities.one(
        b"APPLICATION_PROTOCOL_DEFINITION('international standard','%s',%d,#%d)"
        % (protocol.name, protocol.year, application)
    )
    people = People(entities, header) if protocol.has_people else None
    place = _add_placement(entities)
    made = []
    several = len(bodies) > 1
    root = _add_product(entities, protocol, application, labels.name, people) if several else None
    representations, places = [], []
    for body, named in zip(bodies, labels.bodies, strict=True):
        product = _add_product(entities, protocol, application, named.name, people)
        kind = (
            b"ADVANCED_BREP_SHAPE_REPRESENTATION"
            if body.is_solid
            else b"MANIFOLD_SURFACE_SHAPE_REPRESENTATION"
        )
        shape = entities.one(b"%s('',(#%d,#%d),#%d)" % (kind, place, body.item, context))
        entities.one(b"SHAPE_DEFINITION_REPRESENTATION(#%d,#%d)" % (product.shape, shape))
        made.append(product)
        representations.append(shape)
        places.append(_add_placement(entities) if several else place)
    if root is not None:
        items = b",".join(b"#%d" % each for each in [place, *places])
        whole = entities.one(b"SHAPE_REPRESENTATION('',(%s),#%d)" % (items, context))
        entities.one(b"SHAPE_DEFINITION_REPRESENTATION(#%d,#%d)" % (root.shape, whole))
        for number, (named, product) in enumerate(zip(labels.bodies, made, strict=True)):
            occurrence = _add_occurrence(
                entities, number + 1, text_of(named.name), root, product,
                (representations[number], whole), (place, places[number]),
            )  # fmt: skip
            if people is not None:
                people.sign_occurrence(occurrence)
    return Structure(context, tuple(made))


def _add_occurrence(
    entities: Entities,
    number: int,
    name: bytes,
    root: Product,
    product: Product,
    shapes: tuple[int, int],
    places: tuple[int, int],
) -> int:
    """Add a part of the assembly at its place."""
    occurrence = entities.one(
        b"NEXT_ASSEMBLY_USAGE_OCCURRENCE('%d',%s,'',#%d,#%d,$)"
        % (number, name, root.definition, product.definition)
    )
    placed = entities.one(
        b"PRODUCT_DEFINITION_SHAPE('Placement','Placement of an item',#%d)" % occurrence
    )
    moved = entities.one(b"ITEM_DEFINED_TRANSFORMATION('','',#%d,#%d)" % places)
    relation = entities.one(
        b"(REPRESENTATION_RELATIONSHIP('','',#%d,#%d)"
        b"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#%d)"
        b"SHAPE_REPRESENTATION_RELATIONSHIP())" % (*shapes, moved)
    )
    entities.one(b"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#%d,#%d)" % (relation, placed))
    return occurrence


def _add_product(
    entities: Entities, protocol: Protocol, application: int, name: str, people: People | None
) -> Product:
    text = text_of(name)
    mechanical = entities.one(b"%s('',#%d,'mechanical')" % (protocol.mechanical, application))
    product = entities.one(b"PRODUCT(%s,%s,'',(#%d))" % (text, text, mechanical))
    formation = entities.one(
        b"%s('','',#%d%s)" % (protocol.formation, product, protocol.formation_end)
    )
    design = entities.one(b"%s,#%d,'design')" % (protocol.design, application))
    definition = entities.one(b"PRODUCT_DEFINITION('design','',#%d,#%d)" % (formation, design))
    shape = entities.one(b"PRODUCT_DEFINITION_SHAPE('','',#%d)" % definition)
    related = entities.one(
        b"PRODUCT_RELATED_PRODUCT_CATEGORY('%s',$,(#%d))" % (protocol.category, product)
    )
    made = Product(product, formation, definition, shape)
    if people is not None:
        part = entities.one(b"PRODUCT_CATEGORY('part',$)")
        entities.one(b"PRODUCT_CATEGORY_RELATIONSHIP('','',#%d,#%d)" % (part, related))
        people.sign(made)
    return made


def _add_placement(entities: Entities) -> int:
    """Add the frame of the coordinates themselves."""
    origin = entities.one(b"CARTESIAN_POINT('',(0.,0.,0.))")
    axis = entities.one(b"DIRECTION('',(0.,0.,1.))")
    first = entities.one(b"DIRECTION('',(1.,0.,0.))")
    return entities.one(b"AXIS2_PLACEMENT_3D('',#%d,#%d,#%d)" % (origin, axis, first))


def _add_context(entities: Entities, unit: Unit, tolerance: float) -> int:
    length = _add_length(entities, unit)
    angle = entities.one(b"(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid = entities.one(b"(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    uncertainty = entities.one(
        b"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(%s),#%d,'distance_accuracy_value',"
        b"'confusion accuracy')" % (real(tolerance), length)
    )
    return entities.one(
        b"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#%d))"
        b"GLOBAL_UNIT_ASSIGNED_CONTEXT((#%d,#%d,#%d))REPRESENTATION_CONTEXT('Context #1',"
        b"'3D Context with UNIT and UNCERTAINTY'))" % (uncertainty, length, angle, solid)
    )


def add_millimetre(entities: Entities) -> int:
    """Add the unit in which OpenCascade states lengths, areas and volumes."""
    return entities.one(b"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")


def _add_length(entities: Entities, unit: Unit) -> int:
    prefix = _PREFIXES.get(unit.millimetres)
    if prefix is not None:
        return entities.one(b"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(%s,.METRE.))" % prefix)
    exponents = entities.one(b"DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
    measure = entities.one(
        b"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(%s),#%d)"
        % (real(unit.millimetres), add_millimetre(entities))
    )
    return entities.one(
        b"(CONVERSION_BASED_UNIT('%s',#%d)LENGTH_UNIT()NAMED_UNIT(#%d))"
        % (unit.step.upper().encode("ascii"), measure, exponents)
    )


class People:
    """The people, dates, approvals and security classes that AP203 requires of every product."""

    def __init__(self, entities: Entities, header: FileHeader) -> None:
        self._entities = entities
        add, now = entities.one, stamp_time()
        author = text_of(header.author or "unknown")
        firm = text_of(header.organisation or "unknown")
        person = add(b"PERSON(%s,%s,'',$,$,$)" % (author, author))
        organisation = add(b"ORGANIZATION('',%s,'')" % firm)
        self._who = add(b"PERSON_AND_ORGANIZATION(#%d,#%d)" % (person, organisation))
        self._roles = {
            role: add(b"PERSON_AND_ORGANIZATION_ROLE('%s')" % role)
            for role in (b"creator", b"design_owner", b"design_supplier", b"classification_officer")
        }
        offset = add(b"COORDINATED_UNIVERSAL_TIME_OFFSET(0,$,.EXACT.)")
        clock = add(b"LOCAL_TIME(%d,%d,$,#%d)" % (now.tm_hour, now.tm_min, offset))
        day = add(b"CALENDAR_DATE(%d,%d,%d)" % (now.tm_year, now.tm_mday, now.tm_mon))
        self._when = add(b"DATE_AND_TIME(#%d,#%d)" % (day, clock))
        self._dates = {
            role: add(b"DATE_TIME_ROLE('%s')" % role)
            for role in (b"creation_date", b"classification_date")
        }
        self._level = add(b"SECURITY_CLASSIFICATION_LEVEL('unclassified')")
        status = add(b"APPROVAL_STATUS('not_yet_approved')")
        self._approval = add(b"APPROVAL(#%d,'')" % status)
        role = add(b"APPROVAL_ROLE('approver')")
        add(b"APPROVAL_PERSON_ORGANIZATION(#%d,#%d,#%d)" % (self._who, self._approval, role))
        add(b"APPROVAL_DATE_TIME(#%d,#%d)" % (self._when, self._approval))

    def sign(self, product: Product) -> None:
        """Add what a product needs."""
        secret = self._classify(product.formation)
        self._name(b"creator", product.formation, product.definition)
        self._name(b"design_owner", product.product)
        self._name(b"design_supplier", product.formation)
        self._date(b"creation_date", product.definition)
        self._approve(product.formation, product.definition, secret)

    def sign_occurrence(self, occurrence: int) -> None:
        """Add what a part of an assembly needs."""
        self._approve(self._classify(occurrence))

    def _classify(self, item: int) -> int:
        add = self._entities.one
        secret = add(b"SECURITY_CLASSIFICATION('','',#%d)" % self._level)
        add(b"CC_DESIGN_SECURITY_CLASSIFICATION(#%d,(#%d))" % (secret, item))
        self._name(b"classification_officer", secret)
        self._date(b"classification_date", secret)
        return secret

    def _name(self, role: bytes, *items: int) -> None:
        listed = b",".join(b"#%d" % item for item in items)
        self._entities.one(
            b"CC_DESIGN_PERSON_AND_ORGANIZATION_ASSIGNMENT(#%d,#%d,(%s))"
            % (self._who, self._roles[role], listed)
        )

    def _date(self, role: bytes, item: int) -> None:
        self._entities.one(
            b"CC_DESIGN_DATE_AND_TIME_ASSIGNMENT(#%d,#%d,(#%d))"
            % (self._when, self._dates[role], item)
        )

    def _approve(self, *items: int) -> None:
        listed = b",".join(b"#%d" % item for item in items)
        self._entities.one(b"CC_DESIGN_APPROVAL(#%d,(%s))" % (self._approval, listed))
