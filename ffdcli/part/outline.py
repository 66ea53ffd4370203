"""Outlines of faces in their own parameters: inside tests, and the cells that a face reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.part.record import Part
from ffdcli.part.surfaces import Plane

# Chords of a pcurve between two of its breaks.
_CHORDS = 48
# A coedge whose points are even to this share of the outline is straight.
_STRAIGHT = 1e-12


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
    """The outline of every face."""
    out = []
    for face, (low, high) in enumerate(part.rectangles):
        surface = part.surfaces[face]
        known = _all_chords(part, face)
        if not known and isinstance(surface, Plane):
            known = _all_chords(part, face, surface)
        out.append(_outline(known, low, high))
    return tuple(out)


def outline_on_plane(part: Part, face: int, plane: Plane) -> tuple[Floats, Outline] | None:
    """The rectangle (2, 2) and outline of a planar face in the parameters of a plane.

    They follow from the curves of its edges; None where one has none.
    """
    known = _all_chords(part, face, plane)
    if not known:
        return None
    # Curved edges bulge beyond their chords by an eighth of the second difference, about.
    bulge = max(float(np.abs(np.diff(each, n=2, axis=0)).max(initial=0.0)) for each in known)
    every = np.concatenate(known)
    straight = bulge <= _STRAIGHT * float(np.ptp(every, axis=0).max())
    low, high = every.min(axis=0), every.max(axis=0)
    if not straight:
        low, high = low - bulge / 4, high + bulge / 4
    return np.stack([low, high]), _outline(known, low, high)


def _outline(known: list[Floats], low: Floats, high: Floats) -> Outline:
    """An outline from the points of coedges."""
    if not known:
        return Outline(np.zeros((0, 2)), np.zeros((0, 2)))
    shares = [(each - low) / (high - low) for each in known]
    starts = np.concatenate([each[:-1] for each in shares])
    return Outline(starts, np.concatenate([each[1:] for each in shares]))


def _all_chords(part: Part, face: int, plane: Plane | None = None) -> list[Floats]:
    """Points of all coedges of a face in its parameters, or in those of a plane.

    None of them if some are unknown.
    """
    first, last = part.loop_coedges[part.face_loops[face : face + 2]]
    found = [_chords(part, coedge, plane) for coedge in range(first, last)]
    known = [each for each in found if each is not None]
    return known if len(known) == len(found) else []


def _chords(part: Part, coedge: int, plane: Plane | None) -> Floats | None:
    """Points (n, 2) of a coedge in the parameters of a plane or of its face; None if unknown."""
    edge, pcurve = part.coedge_edge[coedge], part.pcurves[coedge]
    curve = pcurve if plane is None else part.curves[edge]
    if curve is None:
        return None
    low, high = part.edge_range[edge]
    bends = np.concatenate([[low], curve.breaks(low, high).values, [high]])
    steps = np.arange(_CHORDS) / _CHORDS
    inner = (bends[:-1, None] + np.diff(bends)[:, None] * steps).ravel()
    points = curve.points(np.append(inner, high))
    if plane is None:
        return points
    return np.asarray((points - plane.origin) @ np.stack([plane.x, plane.y], axis=1))


def cell_of(breaks: Floats | tuple[float, ...], at: Floats) -> Ints:
    """(n,) interval between breaks (b,) of each value (n,)."""
    return np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, len(breaks) - 2)
