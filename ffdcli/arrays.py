"""Array types, and index arithmetic of runs: rows of unequal length stored one after another.

Run ``i`` of an array of entries is ``entries[starts[i]:starts[i + 1]]``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]


def run_starts(lengths: Ints) -> Ints:
    """(m + 1,) starts of runs with given lengths (m,)."""
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(lengths, dtype=np.int64)])


def run_numbers(starts: Ints) -> Ints:
    """(p,) number of the run that each entry belongs to, for starts (m + 1,) of runs."""
    return np.repeat(np.arange(len(starts) - 1), np.diff(starts))


def places_in_runs(lengths: Ints) -> Ints:
    """(p,) place of every entry within its run: 0, 1, ... for each of the lengths (m,)."""
    starts = run_starts(lengths)
    return np.arange(starts[-1]) - np.repeat(starts[:-1], lengths)


def gather_runs(starts: Ints, chosen: Ints) -> tuple[Ints, Ints]:
    """Select runs: the starts of the result, and the old index of each of its entries.

    Parameters
    ----------
    starts : (n + 1,) int64
    chosen : (m,) int64
        Numbers of runs, in any order; a run may be chosen more than once.

    Returns
    -------
    (m + 1,) int64, (p,) int64
        ``entries[index]`` holds the chosen runs, run ``j`` from ``new_starts[j]`` on.
    """
    lengths = starts[chosen + 1] - starts[chosen]
    return run_starts(lengths), places_in_runs(lengths) + np.repeat(starts[chosen], lengths)


def pad_rows(values: Ints, owner: Ints, count: int) -> Floats:
    """Values (p,) of rising owners (p,) as rows (count, n), NaN after the last of each."""
    lengths = np.bincount(owner, minlength=count)
    out = np.full((count, int(lengths.max(initial=0))), np.nan)
    out[owner, places_in_runs(lengths)] = values
    return out


def distinct_rows(rows: Ints) -> tuple[Ints, Ints]:
    """The distinct rows of integers (m, c), and the number (m,) of each row among them.

    Column by column, which sorts numbers where ``np.unique`` with an axis sorts records.
    """
    which = np.zeros(len(rows), dtype=np.int64)
    sample = np.zeros(0, dtype=np.int64)
    for column in rows.T:
        low = int(column.min(initial=0))
        width = int(column.max(initial=0)) - low + 1
        _, sample, which = np.unique(
            which * width + column - low, return_index=True, return_inverse=True
        )
    return rows[sample], which.reshape(-1)
