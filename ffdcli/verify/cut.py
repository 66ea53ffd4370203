"""Triangles cut along the planes where a deformation changes its polynomial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Floats, Ints, places_in_runs
from ffdcli.deformation import Breaks


def cut_along(corners: Floats, breaks: Sequence[Breaks]) -> tuple[Ints, Floats]:
    """Cut triangles along the breaks of all boxes: triangle and corners of each piece.

    Neighbouring pieces need not share vertices; they only cover the same area.
    """
    owner = np.arange(len(corners))
    for planes in breaks:
        for axis, values in zip(planes.axes, planes.values, strict=True):
            piece, corners = _cut_at(values, (corners - planes.origin) @ axis, corners)
            owner = owner[piece]
    return owner, corners


def _cut_at(values: Floats, heights: Floats, corners: Floats) -> tuple[Ints, Floats]:
    """Cut triangles at parallel planes: triangle and corners of each piece.

    A triangle is cut at its middle corner too. So the part between two cuts is a quadrilateral, or
    a triangle at an end: ``m`` planes cut a triangle into at most ``2 m + 2`` pieces.

    Parameters
    ----------
    values : (m,) float64
        Heights of the planes, rising.
    heights : (n, 3) float64
        Of the corners above the same origin.
    corners : (n, 3, 3) float64
    """
    first = np.searchsorted(values, heights.min(axis=1), side="right")
    count = np.searchsorted(values, heights.max(axis=1), side="left") - first
    whole, crossed = np.flatnonzero(count <= 0), np.flatnonzero(count > 0)
    if not len(crossed):
        return np.arange(len(corners)), corners
    first, count = first[crossed], count[crossed]
    rank = np.argsort(heights[crossed], axis=1)
    risen = np.take_along_axis(heights[crossed], rank, axis=1)
    ends = np.take_along_axis(corners[crossed], rank[:, :, None], axis=1)
    # The levels of each triangle, from its lowest corner to its highest.
    row = np.arange(len(crossed))
    planes = values[np.repeat(first, count) + places_in_runs(count)]
    level = np.concatenate([planes, risen.ravel()])
    of = np.concatenate([np.repeat(row, count), np.repeat(row, 3)])
    order = np.lexsort([level, of])
    level, of = level[order], of[order]
    low, middle, high = risen[of].T
    straight = _between(ends[of, 0], ends[of, 2], level, low, high)
    lower = _between(ends[of, 0], ends[of, 1], level, low, middle)
    upper = _between(ends[of, 1], ends[of, 2], level, middle, high)
    bent = np.where((level > middle)[:, None], upper, lower)
    wide = np.any(straight != bent, axis=1)
    strip = np.flatnonzero((of[1:] == of[:-1]) & (level[1:] > level[:-1]))
    under, over = strip[wide[strip]], strip[wide[strip + 1]]
    pieces = np.concatenate(
        [
            np.stack([straight[under], bent[under], bent[under + 1]], axis=1),
            np.stack([straight[over], bent[over + 1], straight[over + 1]], axis=1),
        ]
    )
    mine = of[np.concatenate([under, over])]
    turned = ((rank[:, 1] - rank[:, 0]) % 3 == 2)[mine]
    pieces[turned] = pieces[turned][:, [0, 2, 1]]
    return np.concatenate([whole, crossed[mine]]), np.concatenate([corners[whole], pieces])


def _between(start: Floats, end: Floats, level: Floats, low: Floats, high: Floats) -> Floats:
    """Points (n, 3) at a level on edges from a low to a high end; the high end of level ones."""
    length = high - low
    share = np.divide(level - low, length, out=np.ones_like(level), where=length > 0)[:, None]
    return (1 - share) * start + share * end
