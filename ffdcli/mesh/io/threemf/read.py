"""3MF files, decoded: objects that the build places, with their names, materials and unit.

The reader is our own: that of trimesh knows no production extension and leaves out materials;
lib3mf holds single precision.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ffdcli.mesh.io.placed_parts import PlacedPart, join_parts
from ffdcli.mesh.io.raw_mesh import RawMesh
from ffdcli.mesh.io.threemf.contents import Contents, Key, find_places, load_contents
from ffdcli.mesh.io.threemf.count import count_placed
from ffdcli.mesh.io.threemf.materials import MaterialTable, read_materials
from ffdcli.mesh.io.threemf.model import ModelObject
from ffdcli.mesh.io.threemf.package import Package, find_root, open_package, quote
from ffdcli.messages import counted
from ffdcli.units import unit_in_words

# Types of objects that are no part of the model.
_LEFT_OUT = ("support", "solidsupport", "other")


def decode_3mf(data: bytes, path: Path) -> RawMesh:
    """All objects that a file builds; texture coordinates are left out.

    Raises
    ------
    FileError
        The file is no 3MF file, refers to what it does not hold, or holds what is not read.
    """
    package = open_package(data, str(path))
    root, found = find_root(package)
    contents = load_contents(package, root)
    unit, unknown = _unit(contents)
    table = read_materials(contents.parts)
    parts, left_out = _placed_parts(contents, table)
    _require_all(contents, [*parts, *(part for _, part in left_out)])
    if not parts:
        kinds = " and ".join(dict.fromkeys(repr(kind) for kind, _ in left_out))
        package.refuse(
            f"the file builds only objects of type {kinds}" if kinds else "no object has triangles",
            "export the model itself",
        )
    notes = [*found, *unknown, *_notes(contents, left_out, table)]
    return join_parts(
        parts,
        path,
        materials=table.materials,
        unit=unit,
        notes=tuple(notes),
        decimals=max(part.decimals for part in contents.parts.values()),
    )


def _placed_parts(
    contents: Contents, table: MaterialTable
) -> tuple[list[PlacedPart], list[tuple[str, PlacedPart]]]:
    """Meshes at their places, and those of kinds that are left out.

    Raises
    ------
    FileError
        An object has no shape that is read.
    """
    taken: list[PlacedPart] = []
    left_out: list[tuple[str, PlacedPart]] = []
    numbers, highest = set[int](), 0
    for key, places in find_places(contents).items():
        thing = contents.thing(key)
        if not len(thing.triangles):
            _require_shape(contents.package, thing)
            continue
        material = table.of_object(key.part, thing)
        for (title, above), (transforms,) in places.items():
            # Groups of objects without a name are called by number: the file's, if it is free.
            number = int(key.number) if key.number.isdecimal() and len(key.number) < 10 else 0
            number = number if number not in numbers else highest + 1
            numbers.add(number)
            highest = max(highest, number)
            part = PlacedPart(
                number,
                title or thing.name or above,
                thing.vertices,
                thing.triangles,
                transforms=transforms,
                material=material,
            )
            if thing.kind in _LEFT_OUT:
                left_out.append((thing.kind, part))
            else:
                taken.append(part)
    return taken, left_out


def _require_shape(package: Package, thing: ModelObject) -> None:
    """Reject an object without triangles that is not simply empty."""
    if thing.unread and not thing.components:
        package.refuse(
            f"{thing.words} has {' and '.join(sorted(thing.unread))}, which is not read, and no "
            "triangles",
            "export it as plain triangles",
        )
    if not thing.shaped:
        package.refuse(f"{thing.words} has neither a mesh nor components")


def _unit(contents: Contents) -> tuple[str | None, list[str]]:
    """Unit of all parts, and a note if it is not known.

    Raises
    ------
    FileError
        Parts have different units.
    """
    units = {name: part.unit for name, part in contents.parts.items()}
    (first, stated), *_ = units.items()
    for name, other in units.items():
        if (unit_in_words(other) or other) != (unit_in_words(stated) or stated):
            contents.package.refuse(
                f"its parts are in several units: {quote(first)} in {quote(stated)}, {quote(name)} "
                f"in {quote(other)}",
                "export it in one unit",
            )
    unit = unit_in_words(stated)
    return unit, [
        f"the unit {quote(stated)} that the file states is not known here: it is left out"
    ] * (unit is None)


def _require_all(contents: Contents, parts: Sequence[PlacedPart]) -> None:
    """Compare what was read with what the file holds, counted anew.

    Raises
    ------
    FileError
        They differ.
    """
    read = (
        sum(len(part.transforms) for part in parts),
        sum(len(part.transforms) * len(part.triangles) for part in parts),
    )
    held = count_placed(contents.package, list(contents.parts))
    if read != held:
        contents.package.refuse(
            f"the file builds {held[0]} meshes with {held[1]} triangles, but {read[0]} with "
            f"{read[1]} were read"
        )


def _notes(
    contents: Contents, left_out: list[tuple[str, PlacedPart]], table: MaterialTable
) -> Iterator[str]:
    """What of the file is not in the mesh, or not as the file has it."""
    things = [contents.thing(key) for key in contents.links]
    for kind in dict.fromkeys(kind for kind, _ in left_out):
        parts = [part for each, part in left_out if each == kind]
        count = sum(len(part.transforms) for part in parts)
        triangles = sum(len(part.transforms) * len(part.triangles) for part in parts)
        yield (
            f"{counted(count, 'object', 'objects')} of type {kind!r} with {triangles} triangles "
            f"{'is' if count == 1 else 'are'} left out"
        )
    for what in sorted({what for thing in things for what in thing.unread}):
        yield _with_first([t for t in things if what in t.unread], f"{what}, which is not read")
    empty = [t for t in things if not len(t.triangles) and not t.components]
    if empty:
        yield _with_first(empty, "no triangles")
    hidden = sum(item.hidden for item, _ in contents.built)
    if hidden:
        yield counted(hidden, "item is", "items are") + " marked as not printable, and read as well"
    loose = sum(
        len(thing.triangles) > 0 and Key(name, number) not in contents.links
        for name, part in contents.parts.items()
        for number, thing in part.objects.items()
    )
    if loose:
        yield counted(loose, "object that is not built is", "objects that are not built are") + (
            " left out"
        )
    if table.mixed:
        yield "mixed materials are read as the material of their largest share"
    if any(part.textured for part in contents.parts.values()):
        yield "texture coordinates of 3MF files are left out"


def _with_first(things: list[ModelObject], what: str) -> str:
    """How many objects have something, and the first."""
    has = counted(len(things), "object has", "objects have")
    return f"{has} {what}{'; the first is' if len(things) > 1 else ':'} {things[0].words}"
