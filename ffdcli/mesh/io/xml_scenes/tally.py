"""What a file places in its scene, and the parsing and sums that the counts of all formats need."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from ffdcli.errors import FileError
from ffdcli.mesh.io.placed_parts import MOST_COPIED
from ffdcli.mesh.io.threemf.package import Package

# Most places of nodes and parts, copies included: all of them are visited one by one.
_MOST_PLACES = 200_000


class Refused(Exception):
    """What is wrong with the file, and what to do."""

    def __init__(self, message: str, hint: str = "export the file again") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True)
class SceneCounts:
    """What a file places in its scene.

    Parameters
    ----------
    triangles : int
        Triangles of all copies; a polygon of n corners counts as n - 2.
    placed : int or None
        Copies of lists of triangles that are not empty; None where the reader joins them.
    notes : tuple of str
        What the file holds beside them.
    """

    triangles: int
    placed: int | None
    notes: tuple[str, ...] = ()

    def require(self, triangles: int, placed: int, path: Path) -> None:
        """Raise a FileError if a reader found other numbers."""
        expected = self.placed if self.placed is not None else placed
        if (triangles, placed) != (self.triangles, expected):
            raise FileError(
                f"the file holds {self.triangles} triangles in {expected} placed lists, but its "
                f"reader returns {triangles} in {placed}",
                file=str(path),
                hint="export it in another format such as .obj or .glb",
            )


def parse_xml(data: bytes) -> Any:
    """The root element; the XML has no document type, which could define entities."""
    from lxml import etree

    def refuse_doctype(*_: object) -> NoReturn:
        raise Refused("the file has a document type", "remove it, or export the file again")

    class Begun(Exception):
        """The first element has begun: no document type follows."""

    def begin(*_: object) -> NoReturn:
        raise Begun

    checker = expat.ParserCreate()
    checker.StartDoctypeDeclHandler = refuse_doctype
    checker.StartElementHandler = begin
    with suppress(Begun):
        checker.Parse(data, True)
    # Without entities nothing multiplies, so long texts are safe.
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        remove_comments=True,
        remove_pis=True,
        huge_tree=True,
    )
    try:
        return etree.fromstring(data, parser)
    except etree.LxmlError as error:
        raise ValueError(str(error)) from None


def parse_part(package: Package, part: str) -> Any:
    """The root element of a part of an archive, whose size has been checked."""
    return parse_xml(b"".join(package.pieces(part)))


def local_name(element: Any) -> str:
    """The name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def count_places(inside: Mapping[Any, Mapping[Any, int]], root: Any) -> Counter[Any]:
    """How often each thing stands in the scene, of the numbers in which things hold others."""
    within: dict[Any, list[Any]] = {root: []}
    reached = [root]
    for thing in reached:
        for child in inside.get(thing, ()):
            if child not in within:
                within[child] = []
                reached.append(child)
            within[child].append(thing)
    try:
        order = list(TopologicalSorter(within).static_order())
    except CycleError:
        raise Refused("a part of the scene is placed in itself") from None
    count = Counter({root: 1})
    for thing in order:
        for child, times in inside.get(thing, {}).items():
            count[child] += times * count[thing]
    if count.total() > _MOST_PLACES:
        message = f"the scene places {count.total()} parts, copies included"
        raise Refused(f"{message}; at most {_MOST_PLACES} are read", "export fewer copies")
    return count


def total(
    lists: Mapping[Any, Iterable[int]], count: Counter[Any], notes: Iterable[str] = ()
) -> SceneCounts:
    """Sums over lists of triangles of the things that stand in the scene."""
    shown = [(each, count[thing]) for thing in lists for each in lists[thing] if each]
    triangles = sum(each * times for each, times in shown)
    stored = sum(each for each, _ in shown)
    if triangles - stored > MOST_COPIED:
        message = f"the file has {stored} triangles and places copies of them, {triangles} in all"
        raise Refused(message, "export fewer copies")
    return SceneCounts(triangles, sum(times for _, times in shown), tuple(dict.fromkeys(notes)))
