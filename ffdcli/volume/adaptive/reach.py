"""Which functions reach each leaf of an octree, listed leaf by leaf."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints, gather_runs


@dataclass(frozen=True)
class Reach:
    """The functions that reach each of some leaves.

    Along an axis the functions of a leaf have few distinct factors; each is listed once.

    Parameters
    ----------
    starts : (m + 1,) int64
        Leaf ``i`` is reached by ``functions[starts[i]:starts[i + 1]]``.
    functions : (p,) int64
    factor_starts : three (m + 1,) int64
    factors : three (q,) int64
        Rows of the table of distinct factors, leaf by leaf.
    places : (p, 3) int64
        Places of each function's factors among the factors of the leaf.
    """

    starts: Ints
    functions: Ints
    factor_starts: tuple[Ints, Ints, Ints]
    factors: tuple[Ints, Ints, Ints]
    places: Ints

    def take(self, rows: Ints) -> Reach:
        """The lists of the chosen leaves, in the given order."""
        starts, index = gather_runs(self.starts, rows)
        pairs = [gather_runs(self.factor_starts[axis], rows) for axis in range(3)]
        u, v, w = (self.factors[axis][pairs[axis][1]] for axis in range(3))
        return Reach(
            starts,
            self.functions[index],
            (pairs[0][0], pairs[1][0], pairs[2][0]),
            (u, v, w),
            self.places[index],
        )


@dataclass(frozen=True)
class Listed:
    """The lists of the leaves that were asked for so far.

    Parameters
    ----------
    row : (N,) int64
        Entry of each leaf of the octree in ``reach``; -1 where it has none yet.
    reach : Reach
    """

    row: Ints
    reach: Reach

    def extended(self, leaves: Ints, more: Reach) -> Listed:
        """The same with the lists of further leaves (m,) appended."""
        row = self.row.copy()
        row[leaves] = len(self.reach.starts) - 1 + np.arange(len(leaves))
        old = self.reach
        first = [_joined(a, b) for a, b in zip(old.factor_starts, more.factor_starts, strict=True)]
        u, v, w = (np.concatenate([a, b]) for a, b in zip(old.factors, more.factors, strict=True))
        reach = Reach(
            _joined(old.starts, more.starts),
            np.concatenate([old.functions, more.functions]),
            (first[0], first[1], first[2]),
            (u, v, w),
            np.concatenate([old.places, more.places]),
        )
        return Listed(row, reach)


def _joined(first: Ints, second: Ints) -> Ints:
    return np.concatenate([first, second[1:] + first[-1]])
