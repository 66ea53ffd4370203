"""Cells whose det J is proved by balls round the derivatives, which is little work.

The Bernstein form of det J of a quotient is of high degree, and made cell by cell. Where a cell's
derivatives differ little, the balls that hold them decide its sign.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.folds.domain import Domain, in_model, repeat_pairs
from ffdcli.volume.protocol import Volume
from ffdcli.volume.slope_hulls import slope_hulls

# Whether hulls are the sharper ones, and whether boxes are divided before: beyond that the form
# itself is less work.
_ROUNDS = ((False, False), (True, False), (True, True), (True, True))


def settle(
    volume: Volume, cells: Ints, domain: Domain, sense: int, enough: float
) -> tuple[float, Ints]:
    """Look for cells on which ``sense * det J`` is well above zero wherever the model is.

    Where the hulls do not tell, sharper ones are tried, on the cells and then on their parts.

    Parameters
    ----------
    volume : Volume
    cells : (m, 3) int64
        Polynomial cells of a volume with positive weights.
    domain : Domain
    sense : {1, -1}
    enough : float
        A bound that is enough; positive.

    Returns
    -------
    float
        The least bound of the parts that are settled.
    (n,) int64
        Cells, by position, that are not settled.
    """
    owner, ends, least = np.arange(len(cells)), volume.cell_bounds(cells), np.inf
    deep, among = np.zeros(len(cells), dtype=bool), np.empty((0, 2), dtype=np.int64)
    if len(cells):
        among = domain.touching(ends[:, 0], ends[:, 1], None)
    for sharp, divided in _ROUNDS:
        if not len(owner):
            break
        if divided:
            parts = np.repeat(np.arange(len(ends)), 8)
            among = repeat_pairs(among, len(ends), parts)
            owner, deep, ends = owner[parts], deep[parts], _eighths(ends)
        kept, deep, pairs = in_model(domain, ends[:, 0], ends[:, 1], deep, among)
        hulls = slope_hulls(volume, cells[owner[kept]], ends[kept], sharp=sharp)
        lower = [hull.least_determinant(sense) for hull in hulls]
        bounds = np.full(len(ends), np.inf)
        bounds[kept] = np.concatenate([np.zeros(0), *lower])
        settled = bounds >= enough
        least = min(least, float(bounds[settled].min(initial=np.inf)))
        left = np.flatnonzero(~settled)
        among = repeat_pairs(pairs, len(ends), left)
        owner, deep, ends = owner[left], deep[left], ends[left]
    return least, np.unique(owner)


def _eighths(ends: Floats) -> Floats:
    """(8 m, 2, 3) boxes (m, 2, 3) halved along every axis."""
    low, high = ends[:, None, 0], ends[:, None, 1]
    middle, upper = (low + high) / 2, np.array([*product((False, True), repeat=3)])
    halves = [np.where(upper, middle, low), np.where(upper, high, middle)]
    return np.stack(halves, axis=2).reshape(-1, 2, 3)
