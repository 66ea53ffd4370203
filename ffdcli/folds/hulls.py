"""A quick lower bound of det J, from balls around the derivatives; tried before the search.

The Bernstein form of det J of a quotient has a high degree and is costly. Where the derivatives on
a cell vary little, balls that contain them decide the sign of det J with less work.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.folds.domain import SearchDomain, in_model, repeat_pairs
from ffdcli.volume.protocol import Volume
from ffdcli.volume.slope_hulls import count_products, slope_hulls

# Per round: whether the sharper hulls are used, and whether boxes are halved first. After these
# rounds the form itself is less work. With a further variable the sharper hulls are too much work.
_ROUNDS = ((False, False), (True, False), (True, True), (True, True))
_ROUGH_ROUNDS = ((False, False), (False, True), (False, True))


def settle(
    volume: Volume,
    cells: Ints,
    domain: SearchDomain,
    sense: int,
    enough: float,
    *,
    nets: Sequence[Floats] = (),
    effort: int,
) -> tuple[float, Ints, int]:
    """Find cells on which ``sense * det J`` is at least ``enough`` all over the model.

    Cells that the hulls do not decide are tried with sharper hulls, then in eight parts, until
    the effort is spent.

    Parameters
    ----------
    volume : Volume
    cells : (m, 3) int64
        Polynomial cells of a volume with positive weights.
    domain : SearchDomain
    sense : {1, -1}
    enough : float
        Bound at which a part is settled; positive.
    nets : control nets, optional
        As for :func:`ffdcli.volume.slope_hulls.slope_hulls`.
    effort : int
        Multiplications after which no further round is begun.

    Returns
    -------
    float
        The least bound of the settled parts.
    (n,) int64
        Positions of the cells that are not settled.
    int
        Multiplications spent.
    """
    owner, ends, least = np.arange(len(cells)), volume.cell_bounds(cells), np.inf
    deep, among = np.zeros(len(cells), dtype=bool), np.empty((0, 2), dtype=np.int64)
    if len(cells):
        among = domain.touching(ends[:, 0], ends[:, 1], None)
    spent = 0
    double = volume.net_kind.components == 8
    for sharp, divided in _ROUGH_ROUNDS if nets else _ROUNDS:
        if not len(owner):
            break
        if sharp and not divided and not double:
            # One quotient has no sharper hull.
            continue
        if divided:
            parts = np.repeat(np.arange(len(ends)), 8)
            among = repeat_pairs(among, len(ends), parts)
            owner, deep, ends = owner[parts], deep[parts], _eighths(ends)
        products = len(ends) * count_products(volume, sharp=sharp, nets=max(1, len(nets)))
        if spent + products > effort:
            break
        spent += products
        kept, deep, pairs = in_model(domain, ends[:, 0], ends[:, 1], deep, among)
        hulls = slope_hulls(volume, cells[owner[kept]], ends[kept], sharp=sharp, nets=nets)
        lower = [hull.least_determinant(sense) for hull in hulls]
        bounds = np.full(len(ends), np.inf)
        bounds[kept] = np.concatenate([np.zeros(0), *lower])
        settled = bounds >= enough
        least = min(least, float(bounds[settled].min(initial=np.inf)))
        left = np.flatnonzero(~settled)
        among = repeat_pairs(pairs, len(ends), left)
        owner, deep, ends = owner[left], deep[left], ends[left]
    return least, np.unique(owner), spent


def _eighths(ends: Floats) -> Floats:
    """(8 m, 2, 3) boxes (m, 2, 3) halved along every axis."""
    low, high = ends[:, None, 0], ends[:, None, 1]
    middle, upper = (low + high) / 2, np.array([*product((False, True), repeat=3)])
    halves = [np.where(upper, middle, low), np.where(upper, high, middle)]
    return np.stack(halves, axis=2).reshape(-1, 2, 3)
