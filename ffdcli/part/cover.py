"""Boxes and points that cover the faces, edges and vertices of a part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.part.outline import Outline
from ffdcli.part.record import Part

# Boxes along each axis of a face or an edge, and steps between samples within a box.
_BOXES, _STEPS = 8, 3


@dataclass(frozen=True, eq=False)
class Cover:
    """Boxes that cover n items, and points on them.

    Parameters
    ----------
    count : int
        Number of items.
    boxes : (b, 2, 3) float64, model length
    owner : (b,) int64
        The item of each box; every item has one at least.
    points : (p, 3) float64, model length
        Points of the items, not of what the parameters of faces reach beyond their outlines.
    point_owner : (p,) int64
    """

    count: int
    boxes: Floats
    owner: Ints
    points: Floats
    point_owner: Ints

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest corners (n, 3) of each item's boxes."""
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        np.minimum.at(low, self.owner, self.boxes[:, 0])
        np.maximum.at(high, self.owner, self.boxes[:, 1])
        return low, high


def cover_faces(part: Part, outlines: Sequence[Outline]) -> Cover:
    """Boxes of parts of every face, without those beyond its outline."""
    shares = np.linspace(0, 1, _BOXES * _STEPS + 1)
    cells = np.linspace(0, 1, _BOXES + 1)
    boxes, owner, points, point_owner = [], [], [], []
    for face, (surface, (low, high), outline) in enumerate(
        zip(part.surfaces, part.rectangles, outlines, strict=True)
    ):
        u, v = low[:, None] + shares * (high - low)[:, None]
        samples = surface.points(u[:, None], v[None, :])
        bends = np.zeros(3)
        for axis in range(2):
            bends += np.abs(np.diff(samples, n=2, axis=axis)).max(axis=(0, 1))
        used = outline.cells(cells, cells)
        windows = np.lib.stride_tricks.sliding_window_view(samples, (_STEPS + 1,) * 2, axis=(0, 1))
        chosen = windows[::_STEPS, ::_STEPS][used]
        boxes.append(_boxes(chosen.reshape(len(chosen), 3, -1), bends))
        owner.append(np.full(len(chosen), face))
        inner = samples[1:-1:2, 1:-1:2][outline.inside(shares[1:-1:2], shares[1:-1:2])]
        border = low + outline.starts * (high - low)
        points += [inner, surface.points(border[:, 0], border[:, 1])]
        point_owner.append(np.full(len(inner) + len(border), face))
    return _cover(part.face_count, boxes, owner, points, point_owner)


def cover_edges(part: Part) -> Cover:
    """Boxes of pieces of every edge; degenerate edges have that of their vertex."""
    shares = np.linspace(0, 1, _BOXES * _STEPS + 1)
    boxes, owner, points, point_owner = [], [], [], []
    for edge, (curve, (low, high)) in enumerate(zip(part.curves, part.edge_range, strict=True)):
        if curve is None:
            samples = np.repeat(part.points[part.edges[edge, :1]], len(shares), axis=0)
        else:
            samples = curve.points(low + shares * (high - low))
        bends = np.abs(np.diff(samples, n=2, axis=0)).max(axis=0)
        windows = np.lib.stride_tricks.sliding_window_view(samples, _STEPS + 1, axis=0)[::_STEPS]
        boxes.append(_boxes(windows, bends))
        owner.append(np.full(len(windows), edge))
        points.append(samples)
        point_owner.append(np.full(len(samples), edge))
    return _cover(len(part.curves), boxes, owner, points, point_owner)


def cover_points(points: Floats) -> Cover:
    """A box of no extent for each of the points (n, 3)."""
    every = np.arange(len(points))
    return Cover(len(points), np.repeat(points[:, None], 2, axis=1), every, points, every)


def _boxes(samples: Floats, bends: Floats) -> Floats:
    """Boxes (b, 2, 3) of samples (b, 3, n), larger by what lies between samples.

    A curve leaves the chord of two samples by an eighth of their second difference, about; a
    quarter is added.
    """
    beside = bends / 4
    return np.stack([samples.min(axis=2) - beside, samples.max(axis=2) + beside], axis=1)


def _cover(
    count: int,
    boxes: list[Floats],
    owner: list[Ints],
    points: list[Floats],
    point_owner: list[Ints],
) -> Cover:
    """Join the lists of all items."""
    return Cover(
        count,
        np.concatenate([np.zeros((0, 2, 3)), *boxes]),
        np.concatenate([np.zeros(0, dtype=np.int64), *owner]),
        np.concatenate([np.zeros((0, 3)), *points]),
        np.concatenate([np.zeros(0, dtype=np.int64), *point_owner]),
    )
