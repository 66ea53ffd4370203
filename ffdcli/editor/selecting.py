"""Selectors, as a person would write them, of any set of control points."""

from __future__ import annotations

from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.lattice.box_lattice import BoxLattice


def selectors_of(lattice: BoxLattice, mask: Bools) -> list[Any]:
    """Values of `at` that together select exactly the control points of a mask.

    Parameters
    ----------
    lattice : BoxLattice
    mask : (m,) bool
    """
    shape = lattice.points.shape[:-1]
    if len(shape) == 1:
        chosen = np.flatnonzero(mask)
        if not len(chosen):
            return []
        hidden: dict[str, Any] = {"hidden": True} if lattice.start.hidden[chosen].any() else {}
        return [{"index": _entry(chosen, shape[0], ends=False), **hidden}]
    return [
        [_entry(each, count) for each, count in zip(block, shape, strict=True)]
        for block in _blocks(mask.reshape(shape))
    ]


def _blocks(mask: Bools) -> list[tuple[Ints, Ints, Ints]]:
    """Products of indices along u, v and w, without overlap, that make up a mask."""
    left, found = mask.copy(), []
    while left.any():
        # The largest product of one row along w with all rows and layers that hold it.
        u, v, _ = np.argwhere(left)[0]
        row = left[u, v]
        along_w = np.flatnonzero(row)
        rows = np.asarray(left[:, :, along_w].all(axis=2))
        along_v = np.flatnonzero(rows[u])
        along_u = np.flatnonzero(rows[:, along_v].all(axis=1))
        found.append((along_u, along_v, along_w))
        left[np.ix_(along_u, along_v, along_w)] = False
    return found


def _entry(indices: Ints, count: int, *, ends: bool = True) -> Any:
    """An index, a slice or a list for ascending indices out of ``count``."""
    if len(indices) == 1:
        index = int(indices[0])
        return -1 if ends and index == count - 1 > 0 else index
    first, last = int(indices[0]), int(indices[-1])
    if last - first + 1 != len(indices):
        return indices.tolist()
    start = "" if first == 0 else str(first)
    return f"{start}:" if last == count - 1 else f"{start}:{last + 1}"
