"""Which cells a fit divides next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.lattice.fit.robust import Neighbours
from ffdcli.lattice.fit.solve import Fitted
from ffdcli.volume.adaptive.octree import Octree, interleave

# Root mean square of normal noise in space over the median disagreement of neighbours.
_NOISE = 1.06
# Standard deviations by which the residual of a cell exceeds the noise, and a share besides.
_SURE = 3.0
_BESIDES = 0.2
# The share for all cells together.
_ALL = 0.03


@dataclass(frozen=True, eq=False)
class Wanting:
    """Cells whose pairs the fit misses by more than the tolerance, the worst first.

    Parameters
    ----------
    cells : (c,) int64
        Leaves of the octree.
    sure : bool
        Whether the residual there is more than noise: it agrees among neighbours. Otherwise these
        are all cells, and only a fit with smaller ones can tell.
    """

    cells: Ints
    sure: bool


def wanting_cells(
    tree: Octree, share: Floats, fitted: Fitted, near: Neighbours | None, tolerance: float
) -> Wanting:
    """The cells to divide.

    Parameters
    ----------
    tree : Octree
        Over the lattice box.
    share : (m, 3) float64
        Places of the pairs as fractions of the box.
    fitted : Fitted
    near : Neighbours or None
    tolerance : float
    """
    top = 1 << tree.depth
    leaf = tree.locate(np.floor(share * top).astype(np.int64).clip(0, top - 1))
    apart = np.linalg.norm(fitted.left, axis=1)
    good = fitted.factors >= 0.5
    count = len(tree.size)
    worst = np.zeros(count)
    np.maximum.at(worst, leaf[good], apart[good])
    over = worst > tolerance
    order = np.argsort(-worst, kind="stable")
    every = order[over[order]]
    if near is None:
        return Wanting(every, False)
    disagree = near.disagreement(fitted.left)
    around = np.median(disagree[near.near], axis=1)
    pairs = np.bincount(leaf[good], minlength=count).clip(1)
    mean = np.bincount(leaf[good], apart[good] ** 2, minlength=count) / pairs
    noise = np.bincount(leaf[good], (_NOISE * around[good]) ** 2, minlength=count) / pairs
    # The mean square of normal noise in space varies by sqrt(2 / 3 n).
    sure = over & (mean > noise * (1 + _BESIDES + _SURE * np.sqrt(2 / (3 * pairs))))
    chosen = order[sure[order]]
    if len(chosen):
        return Wanting(chosen, True)
    # All together tell more than each cell. Where there is nothing but noise, this is the end.
    total = float((apart[good] ** 2).sum() / ((_NOISE * around[good]) ** 2).sum().clip(1e-300))
    white = total < 1 + _ALL + _SURE * np.sqrt(2 / (3 * max(1, int(good.sum()))))
    return Wanting(every[:0] if white and not fitted.silent else every, False)


def divided_codes(tree: Octree) -> list[Ints]:
    """Codes of the divided cells of each level, in units of the level."""
    return [
        np.unique(tree.codes[tree.levels > level] >> 3 * (tree.depth - level))
        for level in range(tree.depth)
    ]


def with_divided(tree: Octree, cells: Ints) -> list[Ints]:
    """:func:`divided_codes` after further leaves are divided."""
    codes = [*divided_codes(tree), np.zeros(0, dtype=np.int64)]
    levels = tree.levels[cells]
    for level in np.unique(levels).tolist():
        low = tree.low[cells[levels == level]] >> (tree.depth - level)
        codes[level] = np.union1d(codes[level], interleave(low))
    return codes if len(codes[-1]) else codes[:-1]


def most_that_fit(cells: Ints, fits: Callable[[Ints], bool]) -> Ints:
    """The longest beginning of the list of cells that fits, by bisection."""
    few, many = 0, len(cells) + 1
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (middle, many) if fits(cells[:middle]) else (few, middle)
    return cells[:few]


def same_cells(first: Sequence[Ints], second: Sequence[Ints]) -> bool:
    """Whether two lists of divided cells are equal."""
    return len(first) == len(second) and all(map(np.array_equal, first, second))
