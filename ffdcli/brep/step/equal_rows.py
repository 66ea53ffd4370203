"""Equal rows of numbers, such as points that several curves and surfaces share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints

# Odd multipliers that spread the bits of a number (Steele and Vigna 2021, table 6).
_FACTORS = np.array([0xD1342543DE82EF95, 0xAF251AF3B0F025B5, 0xB564EF22EC7AECE5], dtype=np.uint64)
_SHIFT = np.uint64(32)


def equal_rows(rows: Floats) -> tuple[Ints, Ints]:
    """Rows (n, k) that differ in some bit: the first of each kind (m,), and each row's kind (n,).

    Kinds are numbered in the order of their first rows. -0 is not 0. Rows of one hash that differ
    may keep rows apart that are equal, which does no harm.
    """
    bits = np.ascontiguousarray(rows).view(np.uint64)
    hashed = _hash(bits)
    order = np.argsort(hashed)
    hashed = hashed[order]
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = hashed[1:] != hashed[:-1]
    same = np.flatnonzero(~begins)
    begins[same] = (bits[order[same]] != bits[order[same - 1]]).any(axis=1)
    del hashed
    starts = np.flatnonzero(begins)
    first = np.minimum.reduceat(order, starts) if len(rows) else order
    kept = np.zeros(len(rows), dtype=bool)
    kept[first] = True
    rank = np.cumsum(kept) - 1
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.repeat(rank[first], np.diff(np.r_[starts, len(rows)]))
    return np.flatnonzero(kept), number


def _hash(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    mixed = np.zeros(len(bits), dtype=np.uint64)
    for column, factor in zip(bits.T, _FACTORS, strict=False):
        mixed = (mixed ^ column) * factor
        mixed ^= mixed >> _SHIFT
    return mixed
