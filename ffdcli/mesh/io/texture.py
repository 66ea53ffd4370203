"""Texture coordinates of polygon corners, as mesh files give them."""

from __future__ import annotations

from itertools import chain

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.messages import counted


def settle(uv: Floats, starts: Ints) -> tuple[Floats | None, str]:
    """Leave out what polygons have at some of their corners only.

    Parameters
    ----------
    uv : (C, 2) float64
        Not finite where there is none.
    starts : (P + 1,) int64

    Returns
    -------
    (C, 2) float64 or None
        NaN at all corners of a polygon or at none; None where no polygon has any.
    str
        What was left out; empty for nothing.
    """
    found = np.isfinite(uv).all(axis=1)
    counts = np.diff(starts)
    ends = np.concatenate([[0], np.cumsum(found)])
    having = ends[starts[1:]] - ends[starts[:-1]]
    whole = having == counts
    some = int(np.count_nonzero(~whole & (having > 0)))
    what = "polygon is", "polygons are"
    note = f"texture coordinates of {counted(some, *what)} not complete: they are left out"
    kept = np.where(np.repeat(whole, counts)[:, None], uv, np.nan) if whole.any() else None
    return kept, note if some else ""


def from_indices(rows: list[bytes], tokens: list[bytes], above: Ints) -> Floats:
    """(C, 2) coordinates of OBJ's corners; NaN where there is none, or one that makes no sense.

    Parameters
    ----------
    rows : list of bytes
        The rest of each ``vt`` statement: one to three numbers.
    tokens : list of bytes
        Each corner of the faces, as ``v/vt/vn``.
    above : (C,) int64
        How many ``vt`` statements stand above the corner, for indices that count back.
    """
    table = np.full((len(rows) + 1, 2), np.nan)
    table[:-1] = _numbers([row.split()[:2] for row in rows])
    texts = [token.partition(b"/")[2].partition(b"/")[0] for token in tokens]
    try:
        index = np.array([text or b"0" for text in texts]).astype(np.int64)
    except (ValueError, OverflowError):
        return np.full((len(tokens), 2), np.nan)
    index = np.where(index < 0, index + above, index - 1)
    return table[np.where((index < 0) | (index >= len(rows)), len(rows), index)]


def _numbers(rows: list[list[bytes]]) -> Floats:
    """(n, 2) numbers; a second one that is not there is 0, rows without sense are NaN."""
    full = [
        row if len(row) == 2 else [*row, b"0", b"0"][:2] if row else [b"nan"] * 2 for row in rows
    ]
    try:
        return np.array(list(chain.from_iterable(full))).astype(np.float64).reshape(-1, 2)
    except ValueError:
        return np.array([_pair(row) for row in full]).reshape(-1, 2)


def _pair(row: list[bytes]) -> tuple[float, float]:
    try:
        return float(row[0]), float(row[1])
    except ValueError:
        return np.nan, np.nan
