"""Tables of numbers in .csv files."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import FileError
from ffdcli.files import require_file

# Largest magnitude of a number. Products of a few coordinates and weights stay finite.
MAX_MAGNITUDE = 1e30
# Bytes of a number and of the separator after it, and of a header, with blanks to spare.
_LONGEST = 64
_HEADER = 4096
_COUNTS = {3: "three", 4: "four", 6: "six", 7: "seven"}


def read_table(
    file: Path,
    headers: Sequence[tuple[str, ...]],
    *,
    most: int,
    need_header: bool = False,
) -> tuple[tuple[str, ...] | None, Floats]:
    """Header, if there is one, and rows (n, columns) of a .csv file; empty lines are skipped.

    Parameters
    ----------
    file : Path
    headers : sequence of tuple of str
        Column names that the first row may have. A file without a header has the columns of the
        first of them.
    most : int
        Largest number of rows.
    need_header : bool
        Reject a file without a header, where the header determines what the numbers mean.

    Raises
    ------
    FileError
        The file cannot be read, has too many rows, or a row has another number of columns; names
        the row.
    """
    width = len(headers[0])
    longest = max(map(len, headers)) * _LONGEST
    allowed = " or ".join(",".join(names) for names in headers)
    most_hint = f"a table here has at most {most:,} rows"
    found: tuple[str, ...] | None = None
    numbers = array("d")

    def fault(message: str, hint: str) -> FileError:
        return FileError(message, file=str(file), hint=hint)

    require_file(file)
    try:
        size = file.stat().st_size
        if size > longest * most + _HEADER:
            raise fault(f"{size:,} bytes are too many for {most:,} rows", most_hint)
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, FileError):
            raise
        raise fault(f"the file cannot be read: {error}", "save it as plain text") from None
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if cells == [""]:
            continue
        names = tuple(cell.lower() for cell in cells)
        if not numbers and found is None and names in headers:
            found, width = names, len(names)
            continue
        if need_header and found is None:
            message = f"row {number} should be the header, not {line[:60]!r}"
            raise fault(message, f"begin the file with {allowed}")
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if len(row) != width:
            columns = allowed if found is None else ",".join(found)
            count = "a number" if width == 1 else f"{_COUNTS[width]} numbers"
            message = f"row {number} is not {count}: {line[:60]!r}"
            raise fault(message, f"write {columns}")
        numbers.extend(row)
        if len(numbers) > most * width:
            raise fault(f"more than {most:,} rows", most_hint)
    return found, np.array(numbers, dtype=np.float64).reshape(-1, width)


def bad_numbers(values: Floats) -> Bools:
    """Where numbers are not finite, or larger than a table or a lattice file may hold."""
    return np.asarray(~(np.abs(values) <= MAX_MAGNITUDE))


def what_is_bad(values: Floats) -> str:
    """What is wrong with numbers of which some are bad."""
    if np.isfinite(values).all():
        return f"a number larger than {MAX_MAGNITUDE:g}"
    return "a number that is not finite"
