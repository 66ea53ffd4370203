"""Files that a lattice file names, and tables of numbers in .csv files."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.files import fault_of
from ffdcli.lattice.file.source import MAX_MAGNITUDE, KeyPath, Source

# Bytes of a number and of the separator after it, and of a header, with blanks to spare.
_LONGEST = 64
_HEADER = 4096


def find_file(name: str, path: KeyPath, source: Source) -> Path:
    """The file that a key of the lattice file names.

    Raises
    ------
    LatticeError
        There is no such file.
    """
    file = source.folder / name
    fault = fault_of(file)
    if fault is not None:
        hint = "paths are relative to the lattice file"
        raise source.error(path, f"`{file}`: {fault}", hint)
    return file


def read_table(
    file: Path,
    headers: Sequence[tuple[str, ...]],
    path: KeyPath,
    source: Source,
    *,
    most: int,
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
    most : int
        Largest number of rows.
    need_header : bool
        Reject a file without a header, where the header determines what the numbers mean.

    Raises
    ------
    LatticeError
        The file cannot be read, has too many rows, or a row has another number of columns; names
        the row.
    """
    width = len(headers[0])
    allowed = " or ".join(",".join(names) for names in headers)
    found: tuple[str, ...] | None = None
    numbers = array("d")
    try:
        size = file.stat().st_size
        if size > _LONGEST * width * most + _HEADER:
            message = f"`{file}` has {size:,} bytes, too many for {most:,} rows"
            raise source.error(path, message, f"a table here has at most {most:,} rows")
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise source.error(path, f"`{file}` cannot be read: {error}", None) from None
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if cells == [""]:
            continue
        names = tuple(cell.lower() for cell in cells)
        if not numbers and found is None and names in headers:
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
        numbers.extend(row)
        if len(numbers) > most * width:
            message = f"`{file}` has more than {most:,} rows"
            raise source.error(path, message, f"a table here has at most {most:,} rows")
    return found, np.array(numbers, dtype=np.float64).reshape(-1, width)


def bad_numbers(values: Floats) -> Bools:
    """Where numbers are not finite, or larger than a lattice file may hold."""
    return np.asarray(~(np.abs(values) <= MAX_MAGNITUDE))


def what_is_bad(values: Floats) -> str:
    """What is wrong with numbers of which some are bad."""
    if np.isfinite(values).all():
        return f"a number larger than {MAX_MAGNITUDE:g}"
    return "a number that is not finite"
