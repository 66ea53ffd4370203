"""Outlines of faces in their own parameters: inside tests, and the cells that a face reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.part.record import Part
from ffdcli.part.surfaces import Plane

# Chords of a pcurve between two of its breaks.
_CHORDS = 48


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
        first, last = part.loop_coedges[part.face_loops[face : face + 2]]
        chords = [_chords(part, face, coedge) for coedge in range(first, last)]
        known = [each for each in chords if each is not None]
        if not known or len(known) < len(chords):
            out.append(Outline(np.zeros((0, 2)), np.zeros((0, 2))))
            continue
        shares = [(each - low) / (high - low) for each in known]
        starts = np.concatenate([each[:-1] for each in shares])
        ends = np.concatenate([each[1:] for each in shares])
        out.append(Outline(starts, ends))
    return tuple(out)


def _chords(part: Part, face: int, coedge: int) -> Floats | None:
    """Points (n, 2) of a coedge in the parameters of its face; None where they are unknown."""
    edge, pcurve, surface = part.coedge_edge[coedge], part.pcurves[coedge], part.surfaces[face]
    low, high = part.edge_range[edge]
    curve = part.curves[edge] if pcurve is None else pcurve
    if curve is None:
        return None
    bends = np.concatenate([[low], curve.breaks(low, high).values, [high]])
    steps = np.arange(_CHORDS) / _CHORDS
    inner = (bends[:-1, None] + np.diff(bends)[:, None] * steps).ravel()
    points = curve.points(np.append(inner, high))
    if pcurve is not None:
        return points
    if not isinstance(surface, Plane):
        return None
    return np.asarray((points - surface.origin) @ np.stack([surface.x, surface.y], axis=1))


def inside_points(outline: Outline, per_axis: int) -> tuple[Floats, Floats]:
    """Points (n, 2) inside a face in shares of its rectangle: of a grid, and of its outline."""
    steps = (np.arange(per_axis) + 0.5) / per_axis
    i, j = np.nonzero(outline.inside(steps, steps))
    return np.stack([steps[i], steps[j]], axis=1), outline.starts


def cell_of(breaks: Floats | tuple[float, ...], at: Floats) -> Ints:
    """(n,) interval between breaks (b,) of each value (n,)."""
    return np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, len(breaks) - 2)
