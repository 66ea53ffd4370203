"""Files that a lattice file names, and tables of numbers in .csv files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.source import KeyPath, Source


def find_file(name: str, path: KeyPath, source: Source) -> Path:
    """The file that a key of the lattice file names.

    Raises
    ------
    LatticeError
        There is no such file.
    """
    file = source.folder / name
    if not file.is_file():
        hint = "paths are relative to the lattice file"
        raise source.error(path, f"there is no file `{file}`", hint)
    return file


def read_table(
    file: Path,
    headers: Sequence[tuple[str, ...]],
    path: KeyPath,
    source: Source,
    *,
    need_header: bool = False,
) -> tuple[tuple[str, ...] | None, Floats]:
    """Header, if there is one, and rows (n, columns) of a .csv file; empty lines are skipped.

    Parameters
    ----------
    file : Path
    headers : sequence of tuple of str
        Column names that the first row may have, all of the same length.
    path, source
        Key of the lattice file that names the file, for messages.
    need_header : bool
        Reject a file without a header, where the header determines what the numbers mean.

    Raises
    ------
    LatticeError
        The file cannot be read, or a row has another number of columns; names the row.
    """
    width = len(headers[0])
    allowed = " or ".join(",".join(names) for names in headers)
    found: tuple[str, ...] | None = None
    rows: list[list[float]] = []
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise source.error(path, f"`{file}` cannot be read: {error}", None) from None
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
            raise source.error(path, message, f"begin the file with {allowed}")
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if len(row) != width:
            count = {1: "a number", 3: "three numbers", 6: "six numbers"}[width]
            message = f"row {number} of `{file}` is not {count}: {line[:60]!r}"
            raise source.error(path, message, f"write {allowed}")
        rows.append(row)
    return found, np.array(rows, dtype=np.float64).reshape(-1, width)
