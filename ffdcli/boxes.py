"""Pairs of boxes that meet, found by halving space."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints

# Boxes that are compared each with each.
_FEW = 48
# Pairs compared together: bounds the memory.
_CHUNK = 1_000_000


def meeting_boxes(low: Floats, high: Floats) -> Ints:
    """(p, 2) pairs of boxes whose interiors meet, each once, the lower number first.

    A box without extent along an axis meets those that hold it inside. Space is halved while that
    parts the boxes, so the work grows with the boxes and the pairs, not with the square.

    Parameters
    ----------
    low, high : (n, 3) float64
    """
    found = [np.zeros((0, 2), dtype=np.int64)]
    space = np.full(3, -np.inf), np.full(3, np.inf)
    waiting: list[tuple[Ints, Floats, Floats]] = [(np.arange(len(low)), *space)]
    while waiting:
        boxes, start, end = waiting.pop()
        cut = _best_cut(low[boxes], high[boxes]) if len(boxes) > _FEW else None
        if cut is None:
            found.append(_meeting_within(boxes, low, high, start, end))
            continue
        axis, place = cut
        below, above = end.copy(), start.copy()
        below[axis] = above[axis] = place
        waiting.append((boxes[low[boxes, axis] < place], start, below))
        beyond = (high[boxes, axis] > place) | (low[boxes, axis] >= place)
        waiting.append((boxes[beyond], above, end))
    return np.concatenate(found)


def _best_cut(low: Floats, high: Floats) -> tuple[int, float] | None:
    """Axis and place of the plane that parts boxes best; None where none parts them well."""
    places = np.median(np.stack([low, high, (low + high) / 2]), axis=1)
    below = np.count_nonzero(low < places[:, None], axis=1)
    above = np.count_nonzero((high > places[:, None]) | (low >= places[:, None]), axis=1)
    cost = np.where(np.maximum(below, above) < len(low), below + above, 2 * len(low))
    best, axis = np.unravel_index(int(np.argmin(cost)), cost.shape)
    if cost[best, axis] > 1.5 * len(low):
        return None
    return int(axis), float(places[best, axis])


def _meeting_within(boxes: Ints, low: Floats, high: Floats, start: Floats, end: Floats) -> Ints:
    """Pairs of chosen boxes that meet, and whose common low corner is in a part of space."""
    found = []
    step = max(1, _CHUNK // max(1, len(boxes)))
    for first in range(0, len(boxes), step):
        some = boxes[first : first + step]
        meets = some[:, None] < boxes
        for axis in range(3):
            meets &= low[some, axis, None] < high[boxes, axis]
            meets &= high[some, axis, None] > low[boxes, axis]
        one, other = np.nonzero(meets)
        pairs = np.stack([some[one], boxes[other]], axis=1)
        corner = low[pairs].max(axis=1)
        found.append(pairs[np.all((corner >= start) & (corner < end), axis=1)])
    return np.concatenate(found) if found else np.zeros((0, 2), dtype=np.int64)
