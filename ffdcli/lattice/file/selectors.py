"""Control points that a selector names."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.file.selector_models import Entry, Inside, Numbered, Selector
from ffdcli.volume.protocol import LatticeMap

# A control point this close to a side of an `inside` box, relative to the lattice, lies on it:
# rest positions are computed (0.30000000000000004), while the box is written by hand.
_ON_SIDE = 1e-9


def entry_indices(entry: Entry, count: int) -> Ints:
    """Ascending indices out of 0..count-1 that an entry (index, list, "start:stop") names.

    Indices must be in range; a slice may be empty.
    """
    if isinstance(entry, str):
        start, stop = (int(part) if part else None for part in entry.split(":"))
        return np.arange(count)[slice(start, stop)]
    return np.unique(np.atleast_1d(np.array(entry, dtype=np.int64)) % count)


def select(at: Selector, places: Floats, rest: LatticeMap | None = None) -> Bools:
    """Control points that a selector names.

    Parameters
    ----------
    at : selector whose indices have been checked
    places : (nu, nv, nw, 3) or (n, 3) float64
        Positions of control points before any edit, in the coordinates of the edits.
    rest : LatticeMap, optional
        The map at rest; an octree's hidden control points are chosen only where asked for.

    Returns
    -------
    (nu, nv, nw) or (n,) bool
    """
    shape = places.shape[:-1]
    chosen = np.zeros(shape, dtype=bool)
    if isinstance(at, tuple):
        axes = [entry_indices(entry, count) for entry, count in zip(at, shape, strict=True)]
        chosen[np.ix_(*axes)] = True
        return chosen
    allowed = np.ones(shape, dtype=bool)
    if rest is not None:
        if at.level is not None:
            allowed &= rest.levels == at.level
        if not at.hidden:
            allowed &= ~rest.hidden
    if isinstance(at, Numbered):
        chosen[entry_indices(at.index, len(chosen))] = True
    elif isinstance(at, Inside):
        slack = _ON_SIDE * np.ptp(places.reshape(-1, 3), axis=0)
        low, high = np.array(at.inside.min) - slack, np.array(at.inside.max) + slack
        chosen = np.asarray(np.all((places >= low) & (places <= high), axis=-1))
    elif allowed.any():
        distances = np.where(allowed, np.linalg.norm(places - np.array(at.near), axis=-1), np.inf)
        chosen.flat[int(np.argmin(distances))] = True
    return chosen & allowed
