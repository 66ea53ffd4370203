"""Points and where they go, as files give them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.fields.table import bad_numbers, what_is_bad
from ffdcli.messages import counted

# Largest number of points of a field.
MAX_POINTS = 1_000_000


@dataclass(frozen=True, eq=False)
class Field:
    """Displacements or targets of points.

    Parameters
    ----------
    sources : (m, 3) float64, field's length unit
        Points of the undeformed object.
    goals : (m, 3) float64, field's length unit
        Displacements of the points, or their targets.
    by : bool
        Whether the goals are displacements.
    weights : (m,) float64
        Weights of the points in a fit; at least 0.
    name : str or None
        Name of the field in its file.
    notes : tuple of str
        What a reader of the file should know, one sentence each.
    """

    sources: Floats
    goals: Floats
    by: bool
    weights: Floats
    name: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def displacements(self) -> Floats:
        """(m, 3) displacements of the points."""
        return self.goals if self.by else self.goals - self.sources


def checked_field(
    file: Path,
    sources: Floats,
    goals: Floats,
    *,
    by: bool,
    weights: Floats | None = None,
    name: str | None = None,
    notes: tuple[str, ...] = (),
    what: str = "pair",
    most: int = MAX_POINTS,
) -> Field:
    """A field whose numbers can be used.

    Parameters
    ----------
    file : Path
        For messages.
    sources, goals, by, weights, name, notes
        See :class:`Field`. Weights are 1 by default.
    what : str
        What a row is, for messages.
    most : int
        Largest number of points.

    Raises
    ------
    FileError
        There are no points or too many, a number is not finite or too large, a weight is negative
        or all are 0; names the first row.
    """

    def fault(message: str, hint: str) -> FileError:
        return FileError(message, file=str(file), hint=hint)

    if not len(sources):
        raise fault(f"the file holds no {what}s", "give a row for each point")
    if len(sources) > most:
        message = f"{len(sources):,} {what}s are more than the {most:,} that are allowed"
        raise fault(message, "give fewer points")
    if weights is None:
        weights = np.ones(len(sources))
    rows = np.column_stack([sources, goals, weights])
    bad = np.flatnonzero(bad_numbers(rows).any(axis=1))
    if len(bad):
        message = f"{what} {bad[0] + 1} holds {what_is_bad(rows[bad[0]])}"
        more = f", and so do {counted(len(bad) - 1, 'other', 'others')}" if len(bad) > 1 else ""
        raise fault(message + more, "leave such points out, or mend them")
    negative = np.flatnonzero(weights < 0)
    if len(negative):
        first = negative[0]
        message = f"{what} {first + 1} has the weight {weights[first]:g}"
        raise fault(message, "weights must be at least 0; 1 is the usual weight")
    if not weights.any():
        raise fault("all weights are 0", "give weights greater than 0")
    return Field(sources, goals, by, weights, name, notes)
