"""Which control points an edit's ``at`` means."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffdcli.lattice.selector_models import Entry, Inside, Near, Selector

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A control point this close to the sides of an `inside` box, relative to the lattice, is on them:
# places at rest are computed (0.30000000000000004), the box is written by hand.
_ON_SIDE = 1e-9


def entry_indices(entry: Entry, count: int) -> Ints:
    """Rising indices, out of 0..count-1, that an entry (index, list, "start:stop") names.

    Indices must be in range; a slice may hold nothing.
    """
    if isinstance(entry, str):
        start, stop = (int(part) if part else None for part in entry.split(":"))
        return np.arange(count)[slice(start, stop)]
    return np.unique(np.atleast_1d(np.array(entry, dtype=np.int64)) % count)


def select(at: Selector, rest: Floats) -> Bools:
    """Control points that a selector means.

    Parameters
    ----------
    at : selector whose indices have been checked
    rest : (nu, nv, nw, 3) float64
        Where control points rest before any edit, in the coordinates of the edits.

    Returns
    -------
    (nu, nv, nw) bool
    """
    chosen = np.zeros(rest.shape[:3], dtype=bool)
    if isinstance(at, Inside):
        slack = _ON_SIDE * np.ptp(rest, axis=(0, 1, 2))
        low, high = np.array(at.inside.min) - slack, np.array(at.inside.max) + slack
        return np.asarray(np.all((rest >= low) & (rest <= high), axis=-1))
    if isinstance(at, Near):
        distances = np.linalg.norm(rest - np.array(at.near), axis=-1)
        chosen.flat[int(np.argmin(distances))] = True
        return chosen
    axes = [entry_indices(entry, count) for entry, count in zip(at, rest.shape[:3], strict=True)]
    chosen[np.ix_(*axes)] = True
    return chosen
