"""Lattices settled entry by entry; what edits have led to is kept, so that one more is cheap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from ffdcli.arrays import Floats
from ffdcli.editor.document import Document, Edits
from ffdcli.editor.history import changed
from ffdcli.folds.model import ModelInBox, place_in_each
from ffdcli.lattice import Lattice, parse_lattice
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.apply import apply_edits
from ffdcli.lattice.file.definition import load_nets, load_pairs, load_scans
from ffdcli.lattice.file.edit_models import MoveEdit
from ffdcli.lattice.file.load import parse_spec
from ffdcli.lattice.lattice_file import MeshGeometry
from ffdcli.mesh import Mesh, shells
from ffdcli.models import as_mesh, settling_facts
from ffdcli.part.record import Part

# Lattices that are kept, of each entry of a file.
_MOST = 256

Entries = Sequence[dict[str, Any]]


def extended(
    lattice: BoxLattice, surface: Floats, values: dict[str, Any], new: Entries
) -> BoxLattice:
    """A settled lattice with some edits more.

    Only these are read and applied.

    Parameters
    ----------
    lattice : BoxLattice
        With the edits that its definition has.
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the model.
    values : mapping
        The keys of the lattice, as in a file.
    new : sequence of mappings

    Raises
    ------
    LatticeError
        An edit is not valid or cannot be applied; names its number and key.
    """
    known, source = lattice.definition, replace(lattice.source, lines={})
    first = len(known.spec.edits)
    # In place of the edits that are known: they keep their numbers, but are not read again.
    stand_ins: list[Any] = [_STILL[known.spec.adaptive]] * first
    if is_grown(values):
        # Such a lattice is valid with the edit alone that divides its cells.
        stand_ins[:1] = known.spec.edits[:1]
    came = parse_spec({**values, "edits": [*stand_ins, *new]}, source).edits[first:]
    some = known.spec.model_copy(update={"edits": (*[_NOTHING] * first, *came)})
    read = replace(
        known,
        spec=known.spec.model_copy(update={"edits": (*known.spec.edits, *came)}),
        nets=load_nets(some, source),
        pairs=load_pairs(some, source),
        scans=load_scans(some, source),
    )
    both = replace(
        read,
        nets={**known.nets, **read.nets},
        pairs={**known.pairs, **read.pairs},
        scans={**known.scans, **read.scans},
    )
    warnings = (*lattice.warnings, *read.notes)
    return apply_edits(replace(lattice, definition=both, warnings=warnings), surface, first)


# Edits that are valid for any lattice with rows and for any octree.
_STILL: dict[bool, dict[str, Any]] = {
    False: {"move": {"at": [0, 0, 0], "by": [0, 0, 0]}},
    True: {"move": {"at": {"near": [0, 0, 0]}, "by": [0, 0, 0]}},
}


# One that names no file.
_NOTHING = MoveEdit.model_validate(_STILL[False])


def is_grown(values: dict[str, Any]) -> bool:
    """Whether the first edit of a lattice divides the cells of its octree."""
    octree = values.get("octree")
    return isinstance(octree, dict) and octree.get("depth") == "auto"


class Stages:
    """The lattices of a document and a model, with any entries.

    Parameters
    ----------
    document : Document
    model : Mesh or Part

    Raises
    ------
    LatticeError
        The lattices do not fit the model.
    """

    def __init__(self, document: Document, model: Mesh | Part) -> None:
        self.document, self.source, self._mesh = document, document.source, as_mesh(model)
        self._geometry = MeshGeometry(**settling_facts(model))
        # Cells that the first edit divides are not there without it.
        self._grown = [is_grown(document.lattice_values(n)) for n in range(len(document.edits))]
        firsts = zip(document.edits, self._grown, strict=True)
        self._firsts: Edits = tuple(edits[: int(grown)] for edits, grown in firsts)
        self._rest = self._at_rest(self._firsts)
        self._kept: list[dict[tuple[int, ...], tuple[Entries, BoxLattice]]] = [
            {tuple(map(id, first)): (first, apply_edits(*rest))}
            for first, rest in zip(self._firsts, self._rest, strict=True)
        ]

    def _at_rest(self, firsts: Edits) -> tuple[tuple[BoxLattice, Floats, int], ...]:
        values = self.document.with_entries(firsts)
        return parse_lattice(values, self.source).at_rest(self._geometry)

    @cached_property
    def models(self) -> tuple[ModelInBox, ...]:
        """The model in the box of each lattice, for proofs."""
        maps = [one.map for one, _, _ in self._rest]
        return place_in_each(self._mesh, shells(self._mesh), maps)

    def settle(self, edits: Edits) -> Lattice:
        """The lattices with these entries.

        Raises
        ------
        LatticeError
        """
        members = tuple(self.member(number, mine) for number, mine in enumerate(edits))
        return Lattice(members, self.source)

    def member(self, number: int, entries: Entries) -> BoxLattice:
        """One lattice with these entries; the same objects are not applied again."""
        kept, first = self._kept[number], tuple(entries[: int(self._grown[number])])
        if tuple(map(id, first)) not in kept:
            firsts = changed(self._firsts, number, lambda _: first)
            rest = self._at_rest(firsts)
            begun = apply_edits(*rest[number])
            self._firsts, self._rest = firsts, rest
            kept.clear()
            kept[tuple(map(id, first))] = (first, begun)
        # The entries are kept too, so that no other ones get their identities.
        names = tuple(map(id, entries))
        done = len(names)
        while names[:done] not in kept:
            done -= 1
        lattice = kept[names[:done]][1]
        for count in range(done + 1, len(names) + 1):
            lattice = self.extended(number, lattice, entries[count - 1 : count])
            kept[names[:count]] = (entries[:count], lattice)
            if len(kept) > _MOST:
                # Not the first one, which the others begin with.
                del kept[list(kept)[1]]
        return lattice

    def extended(self, number: int, lattice: BoxLattice, new: Entries) -> BoxLattice:
        """A lattice with some entries more; nothing is kept."""
        rest, surface, done = self._rest[number]
        # Without entries the lattice at rest would not be what one edit begins with.
        start = lattice if len(lattice.spec.edits) > done else rest
        return extended(start, surface, self.document.lattice_values(number), new)
