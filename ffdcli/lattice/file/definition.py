"""One lattice as a file defines it: its model, and the arrays and tables that it names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.cells import load_cells
from ffdcli.lattice.file.nets import load_nets
from ffdcli.lattice.file.pairs import PairTable, load_pairs
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.volume.adaptive.tlattice import TLattice


@dataclass(frozen=True, eq=False)
class Definition:
    """One lattice of a file, checked, with the contents of the files that it names.

    Parameters
    ----------
    spec : LatticeSpec
        The keys of the file.
    source : Source
        File and lines of the keys, for messages.
    nets : mapping of int to (nu, nv, nw, 3) or (nu, nv, nw) float64
        Control points and weights of the `net` and `weights` edits, by the edit's number.
    pairs : mapping of int to PairTable
        Pairs of the `drag` edits, by the edit's number.
    cells : TLattice or None
        Cells that the file gives in place of an octree.
    """

    spec: LatticeSpec
    source: Source
    nets: Mapping[int, Floats]
    pairs: Mapping[int, PairTable]
    cells: TLattice | None

    @property
    def finest(self) -> Floats:
        """(3,) smallest size of a cell along each axis, as a fraction of the box."""
        if self.cells is None:
            return np.full(3, 0.5**self.spec.deepest)
        return np.asarray((self.cells.high - self.cells.low).min(axis=0) / self.cells.counts)


def load_definition(spec: LatticeSpec, source: Source) -> Definition:
    """Read the files that a checked model names.

    Raises
    ------
    LatticeError
        A file is missing or does not hold what its key needs; names file and key.
    """
    nets, pairs = load_nets(spec, source), load_pairs(spec, source)
    return Definition(spec, source, nets, pairs, load_cells(spec, source))
