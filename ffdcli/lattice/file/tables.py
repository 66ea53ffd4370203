"""Files that a lattice file names, and tables of numbers in .csv files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.fields import table
from ffdcli.files import fault_of
from ffdcli.lattice.file.source import KeyPath, Source


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


@contextmanager
def refused_at(path: KeyPath, source: Source) -> Iterator[None]:
    """Turn what is wrong with a file into an error at the key that names it."""
    try:
        yield
    except FileError as error:
        place = f"`{error.file}`" if error.line is None else f"line {error.line} of `{error.file}`"
        raise source.error(path, f"{place}: {error.message}", error.hint) from None


def read_table(
    file: Path,
    headers: Sequence[tuple[str, ...]],
    path: KeyPath,
    source: Source,
    *,
    most: int,
    need_header: bool = False,
) -> tuple[tuple[str, ...] | None, Floats]:
    """Header, if there is one, and rows (n, columns) of a table that a key names.

    See :func:`ffdcli.fields.table.read_table`.

    Raises
    ------
    LatticeError
        The file cannot be read, has too many rows, or a row has another number of columns; names
        the row.
    """
    with refused_at(path, source):
        return table.read_table(file, headers, most=most, need_header=need_header)
