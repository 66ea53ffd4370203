"""One model part of a 3MF file, parsed: objects, their components, and what is to be built.

Source: 3MF core specification 1.3 and production extension 1.1 (3MF Consortium).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.threemf.package import Package, parse_part, plain_text, quote
from ffdcli.mesh.io.threemf.rows import FEWEST_DECIMALS, TriangleRows, VertexRows

# Extensions that are read, or that change no shape; by the ends of their names.
_KNOWN = ("/core/2015/02", "/material/2015/02", "/production/2015/06", "/trianglesets/2021/07")
# Elements, and an attribute, of extensions that change shapes.
_UNREAD = {
    "beamlattice": "a beam lattice",
    "booleanshape": "a Boolean combination of shapes",
    "displacementmesh": "a displaced mesh",
    "levelset": "a level set",
    "alternatives": "other representations",
    "slicestackid": "slices",
}
_GROUPS = ("basematerials", "colorgroup", "texture2dgroup", "compositematerials", "multiproperties")
_MEMBERS = ("base", "color", "composite", "multi")
# Most elements inside one another.
_MOST_DEEP = 1000
# Most objects, components, items, groups and their members: each takes some kilobytes.
MOST_ENTRIES = 200_000

# A property group and an index in it, as the file states them.
Property = tuple[str | None, str | None]


@dataclass(frozen=True)
class Reference:
    """An object that a component or an item places.

    Parameters
    ----------
    words : str
        The component or item, for messages.
    path : str or None
        Name of the part that holds the object; None for the part of the reference.
    transform : (4, 4) float64
        To the coordinates of whoever places it, applied to columns (x, y, z, 1).
    title : str
        Part number of an item; empty for none.
    hidden : bool
        It is not to be printed.
    """

    words: str
    path: str | None
    number: str
    transform: Floats
    title: str
    hidden: bool


@dataclass(frozen=True)
class PropertyGroup:
    """A group of materials or colours: its kind, its attributes, and those of its members."""

    kind: str
    attributes: Mapping[str, str]
    members: list[Mapping[str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class ModelObject:
    """An object.

    Parameters
    ----------
    words : str
        The object and its part, for messages.
    kind : str
        "model", "solidsupport", "support", "surface" or "other".
    vertices : (V, 3) float64
    triangles : (T, 3) int64
    own : Property
        Properties of the object.
    paint : (T,) int64
        Number in ``paints`` of each triangle's properties.
    paints : tuple of Property
    unread : set of str
        What it has that is not read.
    shaped : bool
        It has a mesh or components.
    """

    number: str
    words: str
    name: str
    kind: str
    vertices: Floats
    triangles: Ints
    own: Property
    paint: Ints
    paints: tuple[Property, ...]
    components: tuple[Reference, ...]
    unread: frozenset[str]
    shaped: bool


@dataclass(frozen=True)
class ModelPart:
    """The content of a part: objects and property groups by their identifiers, and items.

    Its entries are objects, components, items, groups and their members.
    """

    unit: str
    objects: Mapping[str, ModelObject]
    groups: Mapping[str, PropertyGroup]
    items: tuple[Reference, ...]
    textured: bool
    decimals: int
    entries: int


def parse_model(package: Package, part: str, before: int = 0) -> ModelPart:
    """The content of a model part, after ``before`` entries of other parts.

    Raises
    ------
    FileError
        It is no model, needs an extension that is not known, or has an identifier twice, a number
        that is none, or a triangle without its vertices; or there are too many entries.
    """
    reader = _Reader(package, part, before)
    parse_part(package, part, reader.start, reader.end)
    return ModelPart(
        reader.unit,
        reader.objects,
        reader.groups,
        tuple(reader.items),
        reader.textured,
        reader.decimals,
        reader.entries - before,
    )


class _Shape:
    """An object of which not all tags have arrived."""

    def __init__(self, package: Package, number: str, part: str, stated: Mapping[str, str]) -> None:
        self.number, self.stated = number, dict(stated)
        self.words = f"object {plain_text(number)} of {quote(part)}"
        self.vertices = VertexRows(package, self.words)
        self.triangles = TriangleRows(package, self.words)
        self.components: list[Reference] = []
        self.unread: set[str] = set()
        self.meshes = self.lists = 0

    def whole(self) -> ModelObject:
        """The object, all of whose tags have arrived."""
        get = self.stated.get
        vertices = self.vertices.table()
        return ModelObject(
            self.number,
            self.words,
            get("name", ""),
            get("type", "model").strip(),
            vertices,
            self.triangles.table(len(vertices)),
            (get("pid"), get("pindex")),
            self.triangles.paint(),
            tuple(self.triangles.paints),
            tuple(self.components),
            frozenset(self.unread),
            bool(self.meshes or self.lists),
        )


class _Reader:
    """What has arrived of a part; tags come in the order of the file."""

    def __init__(self, package: Package, part: str, before: int) -> None:
        self.package, self.part, self.entries = package, part, before
        self.objects: dict[str, ModelObject] = {}
        self.groups: dict[str, PropertyGroup] = {}
        self.items: list[Reference] = []
        self.unit, self.textured, self.decimals = "", False, FEWEST_DECIMALS
        # Namespace of the core, and how its tags begin.
        self.core: str | None = None
        self.prefix = ""
        self.shape: _Shape | None = None
        self.group: PropertyGroup | None = None
        self.depth = 0
        # The rows that elements of a tag belong to.
        self.tag = ""
        self.rows: VertexRows | TriangleRows | None = None

    def start(self, tag: str, stated: Mapping[str, str], spaces: Mapping[str, str]) -> None:
        """Take a start tag."""
        if tag == self.tag and self.rows is not None:
            self.rows.add(stated)
            return
        self.depth += 1
        if self.depth > _MOST_DEEP:
            self.package.refuse(f"the XML of part {quote(self.part)} is too deep")
        space, _, local = tag.rpartition("}")
        if self.core is None:
            self._start_model(space, local, stated, spaces)
        elif local in _GROUPS:
            self.group = PropertyGroup(local, dict(stated))
            self.groups[self._identifier(stated)] = self.group
        elif local in _MEMBERS and self.group is not None:
            self._count_entry()
            self.group.members.append(dict(stated))
        elif local == "tex2coord":
            self.textured = True
        elif space == self.core:
            self._start_core(local, stated)
        elif local in _UNREAD and self.shape is not None:
            self.shape.unread.add(_UNREAD[local])

    def end(self, tag: str) -> None:
        """Take an end tag."""
        if tag == self.tag:
            return
        self.depth -= 1
        space, _, local = tag.rpartition("}")
        if local in _GROUPS:
            self.group = None
        elif space == self.core and local in ("vertices", "triangles"):
            self.tag, self.rows = "", None
        elif space == self.core and local == "object" and self.shape is not None:
            self.objects[self.shape.number] = self.shape.whole()
            self.decimals = max(self.decimals, self.shape.vertices.decimals)
            self.shape = None

    def _start_model(
        self, space: str, local: str, stated: Mapping[str, str], spaces: Mapping[str, str]
    ) -> None:
        if local != "model":
            self.package.refuse(
                f"part {quote(self.part)} is no 3MF model: its first element is {quote(local)}"
            )
        self.core, self.unit = space, stated.get("unit", "millimeter")
        self.prefix = f"{space}}}" if space else ""
        for prefix in stated.get("requiredextensions", "").split():
            name = spaces.get(prefix, prefix)
            if not name.endswith(_KNOWN):
                self.package.refuse(
                    f"the file requires the extension {quote(name)}, which is not read",
                    "export it as plain triangles",
                )

    def _start_core(self, local: str, stated: Mapping[str, str]) -> None:
        shape = self.shape
        if local == "item":
            self.items.append(self._reference(stated, f"item {len(self.items)} of the build"))
        elif local == "object" and shape is None:
            shape = _Shape(self.package, self._identifier(stated), self.part, stated)
            shape.unread |= {
                what
                for name, what in _UNREAD.items()
                if any(s.endswith("}" + name) for s in stated)
            }
            self.shape = shape
        elif shape is None:
            return
        elif local == "mesh":
            shape.meshes += 1
            if shape.meshes > 1:
                self.package.refuse(f"{shape.words} has two meshes")
        elif local == "components":
            shape.lists += 1
        elif local == "vertices":
            self.tag, self.rows = f"{self.prefix}vertex", shape.vertices
        elif local == "triangles":
            self.tag, self.rows = f"{self.prefix}triangle", shape.triangles
        elif local == "component":
            where = f"component {len(shape.components)} of {shape.words}"
            shape.components.append(self._reference(stated, where))

    def _count_entry(self) -> None:
        self.entries += 1
        if self.entries > MOST_ENTRIES:
            self.package.refuse(
                f"the file has more than {MOST_ENTRIES} objects, components, items and materials",
                "export it with fewer objects",
            )

    def _identifier(self, stated: Mapping[str, str]) -> str:
        """The identifier of a resource, which no other of the part has."""
        self._count_entry()
        number = stated.get("id", "").strip()
        if not number:
            self.package.refuse(f"part {quote(self.part)} has a resource without an identifier")
        if number in self.objects or number in self.groups:
            self.package.refuse(
                f"part {quote(self.part)} has two resources with the identifier {quote(number)}"
            )
        return number

    def _reference(self, stated: Mapping[str, str], words: str) -> Reference:
        self._count_entry()
        paths = [value for name, value in stated.items() if name.rpartition("}")[2] == "path"]
        return Reference(
            words,
            paths[0] if paths else None,
            stated.get("objectid", "").strip(),
            self._transform(stated.get("transform"), words),
            stated.get("partnumber", "").strip(),
            any(
                name.rpartition("}")[2] == "printable" and value.strip() in ("0", "false")
                for name, value in stated.items()
            ),
        )

    def _transform(self, text: str | None, words: str) -> Floats:
        """The (4, 4) matrix of twelve numbers, rows of a matrix that is applied to rows."""
        matrix = np.eye(4)
        if text is None:
            return matrix
        try:
            numbers = [float(number) for number in text.split()]
        except ValueError:
            numbers = [math.nan]
        if len(numbers) != 12 or not np.isfinite(numbers).all():
            self.package.refuse(
                f"the transform of {words} is not twelve finite numbers: {quote(text)}"
            )
        matrix[:3] = np.reshape(numbers, (4, 3)).T
        return matrix
