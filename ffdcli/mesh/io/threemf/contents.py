"""What a 3MF file builds: its parts, the objects that its items reach, and their places.

Source: 3MF core specification 1.3 and production extension 1.1 (3MF Consortium).
"""

from __future__ import annotations

import posixpath
from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.mesh.io.threemf.model import ModelObject, ModelPart, Reference, parse_model
from ffdcli.mesh.io.threemf.package import Package, quote

# Most places of objects, those of assemblies counted as well.
MOST_PLACES = 1_000_000


class Key(NamedTuple):
    """Part and identifier of an object."""

    part: str
    number: str


# Places (n, 4, 4) of an object by its names: what the item that places it calls it, and what the
# assembly is called that it is in.
Places = dict[tuple[str, str], list[Floats]]


@dataclass(frozen=True)
class Contents:
    """What a file builds.

    Parameters
    ----------
    parts : dict of str to ModelPart
        Parts that hold an object that is built, the root first.
    built : list of (Reference, Key)
        Items, and the object of each.
    links : dict of Key to list of (Reference, Key)
        Components of each object that is built, in the order of the build.
    """

    package: Package
    parts: dict[str, ModelPart]
    built: list[tuple[Reference, Key]]
    links: dict[Key, list[tuple[Reference, Key]]]

    def thing(self, key: Key) -> ModelObject:
        """An object."""
        return self.parts[key.part].objects[key.number]


def load_contents(package: Package, root: str) -> Contents:
    """Parse the root and all parts that hold an object that is built.

    Raises
    ------
    FileError
        A part or an object is not there, or nothing is built.
    """
    size = package.check(root)
    parts = {root: parse_model(package, root)}
    entries = parts[root].entries

    def resolve(references: Sequence[Reference], origin: str) -> list[tuple[Reference, Key]]:
        nonlocal size, entries
        found = []
        for each in references:
            part: str | None = origin
            if each.path is not None:
                part = package.find(each.path, posixpath.dirname(origin))
            if part is None:
                package.refuse(
                    f"{each.words} names the part {quote(each.path or '')}, which the file does "
                    "not have",
                    "export it again with all its parts",
                )
            if part not in parts:
                size = package.check(part, size)
                parts[part] = parse_model(package, part, entries)
                entries += parts[part].entries
            if each.number not in parts[part].objects:
                package.refuse(
                    f"{each.words} names object {quote(each.number)}, which {quote(part)} does not "
                    "have",
                    "export it again with all its objects",
                )
            found.append((each, Key(part, each.number)))
        return found

    built = resolve(parts[root].items, root)
    if not built:
        package.refuse(
            "the file has nothing to build: its build has no items",
            "export it with its objects placed on the plate",
        )
    links: dict[Key, list[tuple[Reference, Key]]] = {}
    ahead = [key for _, key in reversed(built)]
    while ahead:
        key = ahead.pop()
        if key not in links:
            links[key] = resolve(parts[key.part].objects[key.number].components, key.part)
            ahead += [child for _, child in reversed(links[key])]
    return Contents(package, parts, built, links)


def find_places(contents: Contents) -> dict[Key, Places]:
    """All places of each object.

    Raises
    ------
    FileError
        An object is inside itself, or the places are too many.
    """
    package, links = contents.package, contents.links
    holders: dict[Key, list[Key]] = {key: [] for key in links}
    for key, components in links.items():
        for _, child in components:
            holders[child].append(key)
    places: dict[Key, Places] = {key: {} for key in links}
    for item, key in contents.built:
        places[key].setdefault((item.title, item.title), []).append(item.transform[None])
    total = len(contents.built)
    try:
        for key in TopologicalSorter(holders).static_order():
            name = contents.thing(key).name
            found = {names: [np.concatenate(each)] for names, each in places[key].items()}
            places[key] = found
            total += sum(len(each) for (each,) in found.values()) * len(links[key])
            if total > MOST_PLACES:
                package.refuse(
                    f"the file places objects at {total} places or more; at most {MOST_PLACES} "
                    "are read",
                    "export fewer copies",
                )
            # What overflows is refused with the place that it gives.
            with np.errstate(over="ignore", invalid="ignore"):
                for component, child in links[key]:
                    for (_, above), (transforms,) in found.items():
                        inner = places[child].setdefault(("", name or above), [])
                        inner.append(transforms @ component.transform)
    except CycleError as error:
        package.refuse(f"{contents.thing(error.args[1][0]).words} is a component of itself")
    return places
