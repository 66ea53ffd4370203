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
    order = np.argsort(hashed, kind="stable")
    sorted_hash, sorted_bits = hashed[order], bits[order]
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = (sorted_hash[1:] != sorted_hash[:-1]) | (sorted_bits[1:] != sorted_bits[:-1]).any(
        axis=1
    )
    first = order[begins]
    rank = np.empty(len(first), dtype=np.int64)
    in_order = np.argsort(first)
    rank[in_order] = np.arange(len(first))
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = rank[np.cumsum(begins) - 1]
    return first[in_order], number


def _hash(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    mixed = np.zeros(len(bits), dtype=np.uint64)
    for column, factor in zip(bits.T, _FACTORS, strict=False):
        mixed = (mixed ^ column) * factor
        mixed ^= mixed >> _SHIFT
    return mixed
