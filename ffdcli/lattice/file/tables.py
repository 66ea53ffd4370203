"""Tables of numbers in .csv files that a lattice file names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.source import KeyPath, Source


def read_table(
    file: Path,
    headers: Sequence[tuple[str, ...]],
    path: KeyPath,
    source: Source,
    *,
    need_header: bool = False,
) -> tuple[tuple[str, ...] | None, Floats]:
    """Header, if there is one, and rows (n, columns) of a .csv file; empty lines are passed over.

    Parameters
    ----------
    file : Path
    headers : sequence of tuple of str
        What the first row may be, all of the same length.
    path, source
        Key of the lattice file that names the file, for messages.
    need_header : bool
        Refuse a file without one, since it says what the numbers mean.

    Raises
    ------
    LatticeError
        A row is not of as many numbers; names it.
    OSError, UnicodeDecodeError
        The file cannot be read.
    """
    width = len(headers[0])
    words = " or ".join(",".join(names) for names in headers)
    found: tuple[str, ...] | None = None
    rows: list[list[float]] = []
    lines = file.read_text(encoding="utf-8-sig").splitlines()
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if cells == [""]:
            continue
        names = tuple(cell.lower() for cell in cells)
        if not rows and found is None and names in headers:
            found = names
            continue
        if need_header and found is None:
            message = f"row {number} of `{file}` should be the header, not {line[:60]!r}"
            raise source.error(path, message, f"begin the file with {words}")
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if len(row) != width:
            count = {1: "a number", 3: "three numbers", 6: "six numbers"}[width]
            message = f"row {number} of `{file}` is not {count}: {line[:60]!r}"
            raise source.error(path, message, f"write {words}")
        rows.append(row)
    return found, np.array(rows, dtype=np.float64).reshape(-1, width)
