"""Array types, and index arithmetic of runs: rows of unequal length stored one after another.

Run ``i`` of an array of entries is ``entries[starts[i]:starts[i + 1]]``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


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
