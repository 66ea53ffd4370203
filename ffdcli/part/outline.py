"""Outlines of faces in their own parameters: inside tests, and the cells that a face reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, places_in_runs
from ffdcli.part.outlines import trace_outlines
from ffdcli.part.record import Part
from ffdcli.part.surfaces import Plane

# Least number of chords over the whole of a rectangle.
_CHORDS = 48
# Bends by no more than this share of the longest chord are none.
_STRAIGHT = 1e-12
# Bends by more than this share of a chord are corners.
_CORNER = 0.3
_NOWHERE = np.zeros((0, 2, 2))


@dataclass(frozen=True)
class Outline:
    """The pcurves of one face as chords, in shares of its rectangle.

    A point is inside if a ray from it crosses the chords an odd number of times.

    Parameters
    ----------
    starts, ends : (s, 2) float64
        Both ends of the chords; none where the face is its whole rectangle.
    """

    starts: Floats
    ends: Floats

    def inside(self, u: Floats, v: Floats) -> Bools:
        """(n, m) True for points of the grid (n,) by (m,) inside; ``u`` must rise."""
        if not len(self.starts):
            return np.ones((len(u), len(v)), dtype=bool)
        low = self.starts[:, 1] <= v[:, None]
        line, chord = np.nonzero(low != (self.ends[:, 1] <= v[:, None]))
        start, end = self.starts[chord], self.ends[chord]
        share = (v[line] - start[:, 1]) / (end[:, 1] - start[:, 1])
        at = np.searchsorted(u, start[:, 0] + share * (end[:, 0] - start[:, 0]))
        crossed = np.zeros((len(u) + 1, len(v)), dtype=np.int64)
        np.add.at(crossed, (at, line), 1)
        return np.asarray(np.cumsum(crossed[:-1], axis=0) % 2 == 1)

    def holds(self, points: Floats) -> Bools:
        """(n,) True for points (n, 2) inside."""
        if not len(self.starts):
            return np.ones(len(points), dtype=bool)
        out = np.zeros(len(points), dtype=np.int64)
        low = self.starts[:, 1] <= points[:, 1:]
        at, chord = np.nonzero(low != (self.ends[:, 1] <= points[:, 1:]))
        start, end = self.starts[chord], self.ends[chord]
        share = (points[at, 1] - start[:, 1]) / (end[:, 1] - start[:, 1])
        crossed = start[:, 0] + share * (end[:, 0] - start[:, 0]) < points[at, 0]
        np.add.at(out, at[crossed], 1)
        return out % 2 == 1

    def cells(self, u: Floats, v: Floats) -> Bools:
        """(n, m) True for cells of the grid between breaks (n + 1,), (m + 1,) that the face meets.

        The outline passes them, or their middle is inside.
        """
        middle = ((each[1:] + each[:-1]) / 2 for each in (u, v))
        out = self.inside(*middle)
        steps = np.linspace(0, 1, 5)[:, None, None]
        passed = (self.starts + steps * (self.ends - self.starts)).reshape(-1, 2)
        i, j = (
            np.clip(np.searchsorted(breaks, passed[:, axis], side="right") - 1, 0, len(breaks) - 2)
            for axis, breaks in enumerate((u, v))
        )
        out[i, j] = True
        return out


def outlines_of(part: Part) -> tuple[Outline, ...]:
    """The outline of every face, in shares of its rectangle."""
    traced = trace_outlines(
        part.pcurves,
        part.edge_range[part.coedge_edge],
        part.coedge_forward,
        part.loop_coedges,
        part.face_loops,
    )
    unknown = np.zeros(part.face_count, dtype=bool)
    unknown[part.face_of_coedge[[each is None for each in part.pcurves]]] = True
    return tuple(
        _outline(traced.ends[first:last] if not open_ else _NOWHERE, rectangle)
        for first, last, open_, rectangle in zip(
            traced.starts[:-1], traced.starts[1:], unknown, part.rectangles, strict=True
        )
    )


def turned_outline(
    outline: Outline, rectangle: Floats, plane: Plane, turned: Plane
) -> tuple[Floats, Outline] | None:
    """The rectangle (2, 2) and outline of a planar face in the parameters of a turned plane.

    Parameters
    ----------
    outline : Outline
        In shares of ``rectangle``; None is returned where it is not known.
    rectangle : (2, 2) float64
        Parameters that the face reaches on ``plane``.
    plane, turned : Plane
        The same plane with other parameters.
    """
    if not len(outline.starts):
        return None
    frame = np.stack([turned.x, turned.y], axis=1)

    def turn(shares: Floats) -> Floats:
        at = rectangle[0] + shares * (rectangle[1] - rectangle[0])
        points = plane.points(at[..., 0], at[..., 1])
        return np.asarray((points - turned.origin) @ frame)

    chords = turn(np.stack([outline.starts, outline.ends], axis=1))
    # Curved edges bulge beyond their chords by an eighth of the bends between these; corners, where
    # the outline turns more than a traced curve does, do not.
    steps = chords[:, 1] - chords[:, 0]
    bends, length = np.abs(np.diff(steps, axis=0)), np.linalg.norm(steps, axis=1)
    turn_less = np.linalg.norm(bends, axis=1) <= _CORNER * length[1:]
    bulge = bends[turn_less].max(axis=0, initial=0.0) / 4
    bulge[bulge <= _STRAIGHT * length.max()] = 0.0
    found = np.stack([chords.min(axis=(0, 1)) - bulge, chords.max(axis=(0, 1)) + bulge])
    return found, _outline(chords, found)


def clip_outline(outline: Outline, rectangle: Floats, bounds: Floats) -> tuple[Floats, Outline]:
    """A rectangle (2, 2) without what lies beyond bounds (2, 2), and the outline in it.

    Rectangles hold more than the outline, since curved edges bulge beyond their chords. Bounds that
    the chords themselves pass count for nothing.
    """
    chords = np.stack([outline.starts, outline.ends], axis=1)
    if not len(chords):
        return rectangle, outline
    chords = rectangle[0] + chords * (rectangle[1] - rectangle[0])
    near = _STRAIGHT * np.abs(rectangle).max()
    low = np.where(chords.min(axis=(0, 1)) < bounds[0] - near, -np.inf, bounds[0])
    high = np.where(chords.max(axis=(0, 1)) > bounds[1] + near, np.inf, bounds[1])
    found = np.stack([np.maximum(rectangle[0], low), np.minimum(rectangle[1], high)])
    return found, _outline(chords, found)


def _outline(ends: Floats, rectangle: Floats) -> Outline:
    """An outline from segments (s, 2, 2), divided so that none is long."""
    extent = rectangle[1] - rectangle[0]
    shares = (ends - rectangle[0]) / np.where(extent > 0, extent, 1.0)
    lengths = np.abs(shares[:, 1] - shares[:, 0]).max(axis=1)
    counts = np.maximum(1, np.ceil(lengths * _CHORDS)).astype(np.int64)
    of, place = np.repeat(np.arange(len(counts)), counts), places_in_runs(counts)
    start, step = shares[of, 0], (shares[of, 1] - shares[of, 0]) / counts[of, None]
    last = (place + 1 == counts[of])[:, None]
    return Outline(
        start + place[:, None] * step,
        np.where(last, shares[of, 1], start + (place[:, None] + 1) * step),
    )


def cell_of(breaks: Floats | tuple[float, ...], at: Floats) -> Ints:
    """(n,) interval between breaks (b,) of each value (n,)."""
    return np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, len(breaks) - 2)
