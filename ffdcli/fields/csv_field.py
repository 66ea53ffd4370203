"""Fields in .csv files."""

from __future__ import annotations

from pathlib import Path

from ffdcli.fields.record import MAX_POINTS, Field, checked_field
from ffdcli.fields.table import read_table

TARGETS = ("x", "y", "z", "tx", "ty", "tz")
DISPLACEMENTS = ("x", "y", "z", "dx", "dy", "dz")
WEIGHT = ("weight",)


def read_csv(file: Path, *, weighted: bool = True, most: int = MAX_POINTS) -> Field:
    """The field of a table ``x,y,z,dx,dy,dz`` or ``x,y,z,tx,ty,tz``, with a column ``weight``.

    Parameters
    ----------
    file : Path
    weighted : bool
        Whether there may be weights.
    most : int
        Largest number of points.

    Raises
    ------
    FileError
        The file cannot be read, its header is another one, or a row is not a pair.
    """
    headers: list[tuple[str, ...]] = [TARGETS, DISPLACEMENTS]
    if weighted:
        headers += [TARGETS + WEIGHT, DISPLACEMENTS + WEIGHT]
    header, rows = read_table(file, headers, most=most, need_header=True)
    by = header is not None and header[3:6] == DISPLACEMENTS[3:]
    weights = rows[:, 6] if rows.shape[1] > 6 else None
    return checked_field(file, rows[:, :3], rows[:, 3:6], by=by, weights=weights)
