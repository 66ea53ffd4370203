"""Cells of a T-lattice kept in a file: a table with a row per cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.file.tables import read_table
from ffdcli.volume.adaptive.octree import Cells
from ffdcli.volume.adaptive.tlattice import BrokenRule, TLattice, tlattice

HEADER = ("u0", "v0", "w0", "u1", "v1", "w1")
PATH: KeyPath = ("octree", "cells")
# Units along an axis: as many as octrees may have, fewer where cells are no parts of halves, since
# the polynomial pieces of the functions are found by halving.
MAX_UNITS = 512
MAX_UNEVEN_UNITS = 128


def load_cells(spec: LatticeSpec, source: Source) -> TLattice | None:
    """The T-lattice that `octree: {cells: FILE}` names, None where it names none.

    Raises
    ------
    LatticeError
        The file is missing or unreadable, a row is no cell, or the cells break a rule of
        T-lattices; names the cells.
    """
    if spec.octree is None or spec.octree.cells is None:
        return None
    file = source.folder / spec.octree.cells
    if not file.is_file():
        raise source.error(
            PATH, f"there is no file `{file}`", "paths are relative to the lattice file"
        )
    try:
        _, rows = read_table(file, (HEADER,), PATH, source, need_header=True)
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, LatticeError):
            raise
        raise source.error(PATH, f"`{file}` cannot be read: {error}", None) from None
    if not len(rows):
        raise source.error(PATH, f"`{file}` holds no cells", "give a row for each cell")
    bad = np.flatnonzero(~((rows >= 0) & (rows <= MAX_UNITS) & (rows == np.rint(rows))).all(axis=1))
    if len(bad):
        message = f"cell {bad[0] + 1} of `{file}` holds other than whole numbers 0 to {MAX_UNITS}"
        hint = "count in units of which the box holds a whole number along each axis"
        raise source.error(PATH, message, hint)
    low, high = rows[:, :3].astype(np.int64), rows[:, 3:].astype(np.int64)
    turned = np.flatnonzero((low > high).any(axis=1))
    if len(turned):
        message = f"cell {turned[0] + 1} of `{file}` ends before it begins"
        raise source.error(PATH, message, "write its low corner first")
    try:
        cells = tlattice(low, high)
    except BrokenRule as broken:
        raise source.error(PATH, *_words(broken, low, high, file)) from None
    if cells.counts.max() > MAX_UNEVEN_UNITS and not _made_by_halving(low, high):
        message = f"`{file}` has {cells.counts.max()} units along an axis and cells that no halving"
        message = f"{message} of the box makes"
        raise source.error(PATH, message, f"use at most {MAX_UNEVEN_UNITS} units for such cells")
    return cells


def cells_text(cells: Cells) -> str:
    """The cells of a T-lattice or an octree as such a file."""
    rows = np.column_stack([cells.low, cells.high]).tolist()
    return "".join(f"{','.join(map(str, row))}\n" for row in (HEADER, *rows))


def _made_by_halving(low: Ints, high: Ints) -> bool:
    """Whether sides are powers of two, and corners multiples of them."""
    side = high - low
    return not np.any(side & (side - 1)) and not np.any(low % side)


def _words(broken: BrokenRule, low: Ints, high: Ints, file: Path) -> tuple[str, str | None]:
    """Message and hint about a broken rule."""
    names = " and ".join(f"cell {number + 1}" for number in broken.cells)
    place = "" if broken.place is None else " to ".join(map(str, broken.place.tolist()))
    if broken.rule == 3:
        (number,) = broken.cells
        axis = "uvw"[int(np.argmax(low[number] == high[number]))]
        return (
            f"{names} of `{file}` breaks rule 3 of T-lattices, no edge is zero: it has no extent "
            f"along {axis}",
            "remove the cell or give it an extent",
        )
    if broken.rule == 2:
        return (
            f"{names} of `{file}` break rule 2 of T-lattices, any edge is an edge of cells: they "
            f"overlap in {place}, so edges of one run through the other",
            "divide the region so that no two cells overlap",
        )
    if broken.rule == 1:
        return (
            f"the cells of `{file}` break rule 1 of T-lattices, knot intervals along parallel "
            f"lines add up to the same: none covers {place}",
            "fill the gap; the cells tile the box from 0 to their highest corner",
        )
    return (
        f"the cells of `{file}` end on too many different planes",
        "let cells end on the same planes where they can, or divide fewer",
    )
