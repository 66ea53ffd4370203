"""Cells of a T-lattice in a .csv file with one row per cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.tables import find_file, read_table
from ffdcli.volume.adaptive.octree import Cells
from ffdcli.volume.adaptive.octree_growth import MAX_CELLS
from ffdcli.volume.adaptive.tlattice import BrokenRule, TLattice, tlattice

HEADER = ("u0", "v0", "w0", "u1", "v1", "w1")
PATH: KeyPath = ("octree", "cells")
# Largest number of units along an axis: as for octrees.
MAX_UNITS = 512


def load_cells(name: str, source: Source) -> TLattice:
    """The T-lattice in the file of `octree: {cells: name}`.

    Raises
    ------
    LatticeError
        The file is missing or cannot be read, a row is not a cell, or cells break a rule of
        T-lattices; names the cells.
    """
    file = find_file(name, PATH, source)
    _, rows = read_table(file, (HEADER,), PATH, source, most=MAX_CELLS, need_header=True)
    if not len(rows):
        raise source.error(PATH, f"`{file}` holds no cells", "give a row for each cell")
    bad = np.flatnonzero(~((rows >= 0) & (rows <= MAX_UNITS) & (rows == np.rint(rows))).all(axis=1))
    if len(bad):
        message = f"cell {bad[0] + 1} of `{file}` must hold whole numbers from 0 to {MAX_UNITS}"
        hint = "choose units that divide the box into a whole number along each axis"
        raise source.error(PATH, message, hint)
    low, high = rows[:, :3].astype(np.int64), rows[:, 3:].astype(np.int64)
    turned = np.flatnonzero((low > high).any(axis=1))
    if len(turned):
        message = f"cell {turned[0] + 1} of `{file}` ends before it begins"
        raise source.error(PATH, message, "write its low corner first")
    try:
        return tlattice(low, high)
    except BrokenRule as broken:
        raise source.error(PATH, *_broken_rule(broken, low, high, file)) from None


def cells_text(cells: Cells) -> str:
    """Text of a .csv file with the cells of a T-lattice or an octree."""
    rows = np.column_stack([cells.low, cells.high]).tolist()
    return "".join(f"{','.join(map(str, row))}\n" for row in (HEADER, *rows))


def _broken_rule(broken: BrokenRule, low: Ints, high: Ints, file: Path) -> tuple[str, str | None]:
    """Message and hint about a broken rule of T-lattices."""
    names = " and ".join(f"cell {number + 1}" for number in broken.cells)
    place = "" if broken.place is None else " to ".join(map(str, broken.place.tolist()))
    if broken.rule == 3:
        (number,) = broken.cells
        axis = "uvw"[int(np.argmax(low[number] == high[number]))]
        message = f"{names} of `{file}` breaks rule 3 of T-lattices, no edge has length 0: "
        return message + f"it has no extent along {axis}", "remove the cell or give it an extent"
    if broken.rule == 2:
        message = f"{names} of `{file}` break rule 2 of T-lattices, any edge is an edge of cells: "
        message += f"they overlap in {place}, so edges of one pass through the other"
        return message, "divide the region so that no two cells overlap"
    if broken.rule == 1:
        message = f"the cells of `{file}` break rule 1 of T-lattices, equal sums of knot intervals "
        message += f"along parallel lines: none covers {place}"
        return message, "fill the gap; the box goes from 0 to the highest corner of the cells"
    return (
        f"the cells of `{file}` end on too many different planes",
        "align the sides of cells, or divide fewer cells",
    )
