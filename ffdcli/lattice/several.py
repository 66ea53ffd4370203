"""Several lattices on one mesh: a `lattices:` list of boxes that have no inner point in common."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_contacts import Contact, shared_sides
from ffdcli.lattice.file.cells import load_cells
from ffdcli.lattice.file.load import parse_parts, parse_spec
from ffdcli.lattice.file.nets import load_nets
from ffdcli.lattice.file.pairs import load_pairs
from ffdcli.lattice.file.source import KeyPath, Source, read_yaml
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.lattice import Lattice
from ffdcli.lattice.layout import lay_out
from ffdcli.lattice.octree_placement import finest_share
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True, eq=False)
class Lattices:
    """Lattices with disjoint boxes on one mesh; immutable.

    Parameters
    ----------
    members : tuple of Lattice
        In the order of the file.
    source : Source
        Where they were read, for messages.
    """

    members: tuple[Lattice, ...]
    source: Source

    @property
    def unit(self) -> str | None:
        """Length unit that the file states."""
        return self.members[0].unit

    @property
    def volumes(self) -> tuple[Volume, ...]:
        """The deforming volumes, all edits applied.

        Raises
        ------
        LatticeError
            The lattices were read without a mesh.
        """
        return tuple(member.volume for member in self.members)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know about how the edits were applied."""
        return tuple(
            f"lattices[{number}]: {text}"
            for number, member in enumerate(self.members)
            for text in member.warnings
        )

    def settle(self, *, bounds: Floats, delta: float, **mesh: Any) -> Lattices:
        """The lattices fitted to a mesh; parameters as for :meth:`Lattice.settle`.

        Where two boxes touch side to side, both sides are locked, so that the deformation is
        continuous across them whatever the mesh does there.

        Raises
        ------
        LatticeError
            Two boxes overlap or come too near each other; or as for one lattice.
        """
        for number, one in enumerate(self.members):
            self._require_alone(number, one.spec)
        layouts = [
            lay_out(one.spec, one.source, bounds, delta, finest_share(one.spec, one.cells))
            for one in self.members
        ]
        size = float(np.linalg.norm(bounds[1] - bounds[0]))
        shared, wrong = shared_sides(layouts, delta, size)
        if wrong is not None:
            raise self._too_near(*wrong)
        settled = tuple(
            one.settle(bounds=bounds, delta=delta, shared=frozenset(sides), **mesh)
            for one, sides in zip(self.members, shared, strict=True)
        )
        return replace(self, members=settled)

    def scaled(self, share: float) -> Lattices:
        """All lattices part of the way; see :meth:`Lattice.scaled`."""
        return replace(self, members=tuple(member.scaled(share) for member in self.members))

    def with_member(self, number: int, lattice: Lattice) -> Lattices:
        """The same with one lattice replaced by an edited version of it."""
        members = list(self.members)
        members[number] = lattice
        return replace(self, members=tuple(members))

    def drag(self, sources: Any, targets: Any, **options: Any) -> Lattices:
        """Drag points; each by the lattice in whose box it lies.

        Parameters
        ----------
        sources, targets : (m, 3) float
        options
            As for :meth:`Lattice.drag`; they go to every lattice that has a point to drag.

        Raises
        ------
        LatticeError
            A source lies in none of the boxes; or as for one lattice.
        """
        sources = np.asarray(sources, dtype=np.float64)
        targets = np.asarray(targets, dtype=np.float64)
        if sources.ndim != 2 or sources.shape[1:] != (3,) or targets.shape != sources.shape:
            message = f"sources and targets are (m, 3) arrays, not {sources.shape}, {targets.shape}"
            raise LatticeError(message, file=self.source.name)
        dragged, free = self, np.ones(len(sources), dtype=bool)
        for number, volume in enumerate(self.volumes):
            mine = free & volume.contains(volume.frame.to_local(sources))
            free &= ~mine
            if mine.any():
                moved = self.members[number].drag(sources[mine], targets[mine], **options)
                dragged = dragged.with_member(number, moved)
        if free.any():
            place = ", ".join(f"{value:g}" for value in sources[free][0])
            message = f"the point ({place}) lies in none of the lattice boxes"
            raise LatticeError(message, file=self.source.name, hint="drag points inside a box")
        return dragged

    def _require_alone(self, number: int, spec: LatticeSpec) -> None:
        """Some lattices reach beyond what a `box` says; they cannot stand beside others."""
        if len(self.members) == 1 or spec.octree is None:
            return
        if spec.volume == "hierarchical":
            message = "a hierarchical volume fades out beyond its box, into the other lattices"
            here: KeyPath = ("lattices", number, "volume")
            raise self.source.error(here, message, "give it a file of its own, or use tspline")
        if spec.octree.embedding == "inverse":
            message = "an inverted volume needs the whole mesh in its box"
            here = ("lattices", number, "octree", "embedding")
            raise self.source.error(here, message, "give it a file of its own, or remove this key")
        if spec.octree.region != "auto":
            message = "beside other lattices a box must be given"
            hint = "say `region: auto` and give a `box`"
            raise self.source.error(("lattices", number, "octree", "region"), message, hint)

    def _too_near(self, first: int, second: int, contact: Contact) -> LatticeError:
        names = f"lattices[{first}] and lattices[{second}]"
        lengths = f"{abs(contact.gap):.3g}"
        if contact.sides is None and contact.gap < 0 and not self._given(first, second):
            message = f"the boxes of {names} overlap: an automatic box spans the whole mesh"
            return self.source.error(("lattices", second), message, "give each its own `box`")
        if contact.gap < 0:
            message = f"the boxes of {names} overlap by {lengths}"
            hint = "move them apart, or let them touch side to side"
        else:
            message = f"the boxes of {names} are only {lengths} apart, and do not touch"
            hint = "move them apart, or let whole sides lie in one plane"
        here = ("lattices", second, "box")
        return self.source.error(here, message, hint)

    def _given(self, *numbers: int) -> bool:
        return all(self.members[number].spec.box != "auto" for number in numbers)


AnyLattice = Lattice | Lattices


def load_lattice(path: str | Path) -> AnyLattice:
    """Read and check a lattice file and the control nets it names; no mesh is needed yet.

    Returns
    -------
    Lattice or Lattices
        Lattices where the file has the key `lattices`.

    Raises
    ------
    FileError
        The file cannot be read.
    LatticeError
        It is no valid lattice file; names line and key.
    """
    data, source = read_yaml(path)
    if not (isinstance(data, dict) and "lattices" in data):
        return _load(parse_spec(data, source), source)
    parts = parse_parts(data, source)
    members = [_load(spec, source.within(("lattices", i))) for i, spec in enumerate(parts)]
    return Lattices(tuple(members), source)


def _load(spec: LatticeSpec, source: Source) -> Lattice:
    nets, pairs = load_nets(spec, source), load_pairs(spec, source)
    return Lattice(spec, source, nets, pairs, load_cells(spec, source))
