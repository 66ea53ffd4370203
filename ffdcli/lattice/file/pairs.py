"""Pairs of a drag: points of the object with targets or displacements, from the file or a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.file.drag_models import Drag
from ffdcli.lattice.file.edit_models import DragEdit
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.file.tables import find_file, read_table

_TARGETS = ("x", "y", "z", "tx", "ty", "tz")
_DISPLACEMENTS = ("x", "y", "z", "dx", "dy", "dz")


@dataclass(frozen=True)
class PairTable:
    """Pairs of a drag, in model coordinates.

    Parameters
    ----------
    sources : (m, 3) float64
        Points of the undeformed object.
    goals : (m, 3) float64
        Targets of their images, or displacements.
    by : (m,) bool
        True for goals that are displacements.
    """

    sources: Floats
    goals: Floats
    by: Bools

    def take(self, rows: Bools) -> PairTable:
        """The pairs in ``rows`` (m,) alone."""
        return PairTable(self.sources[rows], self.goals[rows], self.by[rows])


def load_pairs(spec: LatticeSpec, source: Source) -> dict[int, PairTable]:
    """The pairs of all `drag` edits, by the edit's number.

    Raises
    ------
    LatticeError
        A table is missing, cannot be read, or has a row that is not a pair; names the row.
    """
    return {
        index: _pairs(edit.drag, ("edits", index, "drag", "pairs"), source)
        for index, edit in enumerate(spec.edits)
        if isinstance(edit, DragEdit)
    }


def _pairs(drag: Drag, path: KeyPath, source: Source) -> PairTable:
    if isinstance(drag.pairs, str):
        return _read(drag.pairs, path, source)
    sources = np.array([pair.source for pair in drag.pairs], dtype=np.float64)
    goals = [pair.to if pair.by is None else pair.by for pair in drag.pairs]
    by = np.array([pair.by is not None for pair in drag.pairs])
    return PairTable(sources, np.array(goals, dtype=np.float64), by)


def _read(name: str, path: KeyPath, source: Source) -> PairTable:
    file = find_file(name, path, source)
    headers = (_TARGETS, _DISPLACEMENTS)
    header, rows = read_table(file, headers, path, source, need_header=True)
    if not len(rows):
        raise source.error(path, f"`{file}` holds no pairs", "give a row for each point")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        message = f"pair {bad[0] + 1} of `{file}` holds a number that is not finite"
        raise source.error(path, message, None)
    return PairTable(rows[:, :3], rows[:, 3:], np.full(len(rows), header == _DISPLACEMENTS))
