"""Triangles cut along the planes where a deformation changes its polynomial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.deformation import Breaks


def cut_along(corners: Floats, breaks: Sequence[Breaks]) -> tuple[Ints, Floats]:
    """Cut triangles along the breaks of all boxes: triangle and corners of each piece."""
    owner = np.arange(len(corners))
    for planes in breaks:
        piece, corners = _cut_box(corners, planes)
        owner = owner[piece]
    return owner, corners


def _cut_box(corners: Floats, breaks: Breaks) -> tuple[Ints, Floats]:
    """Cut triangles along the breaks of one box: triangle and corners of each piece.

    Neighbouring pieces need not share vertices; they only cover the same area.
    """
    owner = np.arange(len(corners))
    local = (corners - breaks.origin) @ breaks.axes.T
    for axis, values in enumerate(breaks.values):
        for value in np.unique(values):
            height = local[:, :, axis] - value
            crossed = (height.min(axis=1) < 0) & (height.max(axis=1) > 0)
            if not crossed.any():
                continue
            height = height[crossed]
            above = height > 0
            single = np.where(above.sum(axis=1) == 1, above.T, (height < 0).T).T
            turn = (np.argmax(single, axis=1)[:, None] + np.arange(3)) % 3
            row = np.arange(len(turn))[:, None]
            height = height[row, turn]
            pieces = [_three(points[crossed][row, turn], height) for points in (corners, local)]
            corners = np.concatenate([corners[~crossed], pieces[0]])
            local = np.concatenate([local[~crossed], pieces[1]])
            owner = np.concatenate([owner[~crossed], np.tile(owner[crossed], 3)])
    return owner, corners


def _three(corner: Floats, height: Floats) -> Floats:
    """Cut triangles (n, 3, 3) whose first corner is alone on its side into pieces (3 n, 3, 3)."""
    ratio = height[:, :1] / (height[:, :1] - height[:, 1:])
    cut = corner[:, :1] + ratio[:, :, None] * (corner[:, 1:] - corner[:, :1])
    return np.concatenate(
        [
            np.stack([corner[:, 0], cut[:, 0], cut[:, 1]], axis=1),
            np.stack([cut[:, 0], corner[:, 1], corner[:, 2]], axis=1),
            np.stack([cut[:, 0], corner[:, 2], cut[:, 1]], axis=1),
        ]
    )
