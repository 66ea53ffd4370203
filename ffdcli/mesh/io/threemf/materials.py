"""Materials of a 3MF file: base materials and colours, and what refers to them.

Source: 3MF core specification 1.3 and materials and properties extension 1.2 (3MF Consortium).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.labels import Colour, Material
from ffdcli.mesh.io.threemf.model import ModelObject, ModelPart, Property, PropertyGroup

_SIMPLE = {"basematerials": ("name", "displaycolor"), "colorgroup": ("", "color")}
_LONGEST_INDEX = 9


@dataclass(frozen=True)
class MaterialTable:
    """Materials of all parts, in the order of the parts and of their groups.

    Parameters
    ----------
    groups : mapping of str to mapping of str to PropertyGroup
        Groups of each part, by their identifiers.
    first : mapping of (part, group) to int
        Number of the first material of each group that has materials of its own.
    """

    materials: tuple[Material, ...]
    groups: Mapping[str, Mapping[str, PropertyGroup]]
    first: Mapping[tuple[str, str], int]

    @property
    def mixed(self) -> bool:
        """Whether there are composites, which are read as the material of the largest share."""
        return any(
            group.kind == "compositematerials"
            for groups in self.groups.values()
            for group in groups.values()
        )

    def of_object(self, part: str, thing: ModelObject) -> Ints:
        """(T,) number of the material of each triangle; -1 for none.

        A triangle whose corners differ has the material of its first corner.
        """
        own = thing.own
        stated = [
            (own[0] if group is None else group, index) if index else own
            for group, index in thing.paints
        ]
        numbers = np.array([self._number(part, each) for each in stated], dtype=np.int64)
        return numbers[thing.paint] if len(numbers) else thing.paint

    def _number(self, part: str, stated: Property) -> int:
        number = (stated[0] or "").strip()
        index = _index(stated[1] or "")
        group = self.groups[part].get(number)
        if group is None or index is None:
            return -1
        if group.kind in _SIMPLE:
            return self.first[part, number] + index if index < len(group.members) else -1
        if index >= len(group.members):
            return -1
        if group.kind == "compositematerials":
            return self._number_of_composite(part, group, group.members[index])
        if group.kind == "multiproperties":
            layers = group.attributes.get("pids", "").split()
            places = group.members[index].get("pindices", "").split()
            for layer, place in zip(layers, places + ["0"] * len(layers), strict=False):
                below = self.groups[part].get(layer)
                if below is not None and below.kind != "multiproperties":
                    found = self._number(part, (layer, place))
                    if found >= 0:
                        return found
        return -1

    def _number_of_composite(
        self, part: str, group: PropertyGroup, member: Mapping[str, str]
    ) -> int:
        """The base material of the largest share, the first of equal ones."""
        base = self.groups[part].get(group.attributes.get("matid", "").strip())
        choice = group.attributes.get("matindices", "").split()
        shares = [_share(text) for text in member.get("values", "").split()][: len(choice)]
        if base is None or base.kind != "basematerials" or not choice:
            return -1
        largest = shares.index(max(shares)) if shares else 0
        return self._number(part, (group.attributes.get("matid"), choice[largest]))


def read_materials(parts: Mapping[str, ModelPart]) -> MaterialTable:
    """All base materials and colours."""
    materials: list[Material] = []
    first = {}
    for name, part in parts.items():
        for number, group in part.groups.items():
            if group.kind in _SIMPLE:
                first[name, number] = len(materials)
                title, colour = _SIMPLE[group.kind]
                for each in group.members:
                    shown = each.get(colour, "")
                    materials.append(Material(each.get(title, shown), _hex_colour(shown)))
    groups = {name: part.groups for name, part in parts.items()}
    return MaterialTable(tuple(materials), groups, first)


def _index(text: str) -> int | None:
    plain = text.strip()
    return int(plain) if plain.isdecimal() and len(plain) <= _LONGEST_INDEX else None


def _share(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def _hex_colour(text: str) -> Colour | None:
    if re.fullmatch(r"#[0-9A-Fa-f]{6}([0-9A-Fa-f]{2})?", text) is None:
        return None
    red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return red, green, blue
