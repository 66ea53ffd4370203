"""Instances and triangles of a 3MF file, counted by another XML parser from tags alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from graphlib import TopologicalSorter
from xml.parsers import expat

from ffdcli.mesh.io.threemf.package import Package

# Part and identifier of an object.
_Key = tuple[str, str]


def count_placed(package: Package, parts: Sequence[str]) -> tuple[int, int]:
    """Instances of meshes with triangles that a file builds, and their triangles.

    The parts, the root first, have been parsed before, so their XML is sound.
    """
    triangles: Counter[_Key] = Counter()
    places: dict[_Key, Counter[_Key]] = {}
    built: Counter[_Key] = Counter()
    for part in parts:
        _count_part(package, part, triangles, places, built if part == parts[0] else Counter())
    # What holds each object that is built.
    inside: dict[_Key, list[_Key]] = {key: [] for key in built}
    reached = list(built)
    for key in reached:
        for child in places.get(key, ()):
            if child not in inside:
                reached.append(child)
            inside.setdefault(child, []).append(key)
    count = Counter(built)
    for key in TopologicalSorter(inside).static_order():
        for child, times in places.get(key, {}).items():
            count[child] += times * count[key]
    return (
        sum(count[key] for key in triangles),
        sum(count[key] * many for key, many in triangles.items()),
    )


def _count_part(
    package: Package,
    part: str,
    triangles: Counter[_Key],
    places: dict[_Key, Counter[_Key]],
    built: Counter[_Key],
) -> None:
    """Count the triangles and components of each object of a part, and the items of the build."""
    folder = part.rpartition("/")[0]
    here: _Key = (part, "")
    space: str | None = None

    def key_of(stated: Mapping[str, str]) -> _Key:
        path = next((v for k, v in stated.items() if k.rpartition(" ")[2] == "path"), None)
        place = part if path is None else package.find(path, folder)
        return place or "", stated.get("objectid", "").strip()

    def start(name: str, pairs: list[str]) -> None:
        nonlocal here, space
        prefix, _, local = name.rpartition(" ")
        if space is None:
            space = prefix
        if prefix != space:
            return
        if local == "triangle":
            triangles[here] += 1
        elif local in ("object", "component", "item"):
            stated = dict(zip(pairs[::2], pairs[1::2], strict=True))
            if local == "object":
                here = part, stated.get("id", "").strip()
                places.setdefault(here, Counter())
            elif local == "component":
                places.setdefault(here, Counter())[key_of(stated)] += 1
            else:
                built[key_of(stated)] += 1

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.ordered_attributes = True
    parser.StartElementHandler = start
    try:
        for piece in package.pieces(part):
            parser.Parse(piece, False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        package.unreadable(part, error)
