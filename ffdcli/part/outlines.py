"""Outlines of faces in the parameters of their surfaces: rectangles and inside tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, run_starts
from ffdcli.part.curves import Curve
from ffdcli.part.surfaces import Surface

# Segments of a curved pcurve.
_PIECES = 64
# Largest gap that is closed, as a share of the outline's extent.
_GAP = 1e-3
# More than a period by this share is a period.
_ROUND = 1e-6
# Pairs of a point and a segment per pass.
_PAIRS = 2_000_000


@dataclass(frozen=True, eq=False)
class Outlines:
    """Segments in surface parameters, face after face.

    Parameters
    ----------
    starts : (F + 1,) int64
        Face ``f`` has segments ``starts[f]:starts[f + 1]``.
    ends : (S, 2, 2) float64
        From, to; in no order.
    sag : (S, 2) float64
        Largest distance of the pcurve from the segment, along u and along v.
    """

    starts: Ints
    ends: Floats
    sag: Floats

    def inside(self, face: int, points: Floats) -> Bools:
        """Whether points (n, 2) lie inside a face: a ray crosses the outline an odd time."""
        segments = self.ends[self.starts[face] : self.starts[face + 1]]
        if not len(segments):
            return np.ones(len(points), dtype=bool)
        out = np.zeros(len(points), dtype=bool)
        step = max(1, _PAIRS // len(segments))
        for begin in range(0, len(points), step):
            part = slice(begin, begin + step)
            out[part] = _odd(segments, points[part])
        return out


def trace_outlines(
    pcurves: tuple[Curve | None, ...],
    ranges: Floats,
    forward: Bools,
    loop_coedges: Ints,
    face_loops: Ints,
) -> Outlines:
    """Outlines of all faces; small gaps between pcurves are closed.

    Parameters
    ----------
    pcurves, forward, loop_coedges, face_loops
        As of :class:`~ffdcli.part.record.Part`.
    ranges : (C, 2) float64
        Of the edge of each coedge.
    """
    lines: list[Floats] = []
    sags: list[Floats] = []
    for curve, (low, high), ahead in zip(pcurves, ranges, forward, strict=True):
        if curve is None:
            lines.append(np.zeros((0, 2)))
            sags.append(np.zeros((0, 2)))
            continue
        count = 1 if curve.kind == "line" else _PIECES
        line = curve.points(np.linspace(low, high, count + 1))
        bend = np.zeros((count + 1, 2))
        if count > 1:
            # A curve leaves its chord by an eighth of the second difference.
            bend[1:-1] = np.abs(np.diff(line, 2, axis=0)) / 8
            bend[:-1] = np.maximum(bend[:-1], bend[1:])
        lines.append(line if ahead else line[::-1])
        sags.append(bend[:-1] if ahead else bend[-2::-1])
    ends, sag, lengths = [], [], []
    for first, last in zip(
        loop_coedges[face_loops[:-1]], loop_coedges[face_loops[1:]], strict=True
    ):
        known = [each for each in range(first, last) if len(lines[each])]
        found = [np.zeros((0, 2, 2))]
        found += [np.stack([lines[each][:-1], lines[each][1:]], axis=1) for each in known]
        gaps = _gaps(np.array([lines[each][[0, -1]] for each in known]).reshape(-1, 2, 2))
        ends.append(np.concatenate([*found, gaps]))
        sag.append(np.concatenate([*(sags[each] for each in known), np.zeros((len(gaps), 2))]))
        lengths.append(len(ends[-1]))
    return Outlines(
        run_starts(np.array(lengths, dtype=np.int64)),
        np.concatenate([np.zeros((0, 2, 2)), *ends]),
        np.concatenate([np.zeros((0, 2)), *sag]),
    )


def rectangles_of(surfaces: tuple[Surface, ...], domains: Floats, outlines: Outlines) -> Floats:
    """The parameters (F, 2, 2) that each face reaches: of its outline, else of its surface.

    Parameters
    ----------
    surfaces : (F,) tuple of Surface
    domains : (F, 2, 2) float64
        Lowest and highest parameters of each surface.
    outlines : Outlines
    """
    out = np.array(domains, dtype=np.float64)
    for number, surface in enumerate(surfaces):
        part = slice(outlines.starts[number], outlines.starts[number + 1])
        ends, sag = outlines.ends[part], outlines.sag[part, None]
        if not len(ends):
            continue
        beyond = _beyond(np.abs(ends[:, 1] - ends[:, 0])[:, None], sag)
        low, high = (ends - beyond).min(axis=(0, 1)), (ends + beyond).max(axis=(0, 1))
        free = np.array([period is not None for period in surface.periods])
        # Both sides of a seam are then the sides of the rectangle.
        over = high - low - [period or np.inf for period in surface.periods]
        over = np.where((over > 0) & (over <= _ROUND * (high - low)), over, 0.0)
        low, high = low + over / 2, high - over / 2
        out[number, 0] = np.where(free, low, np.maximum(low, out[number, 0]))
        out[number, 1] = np.where(free, high, np.minimum(high, out[number, 1]))
    return out


def _beyond(advance: Floats, sag: Floats) -> Floats:
    """How far pcurves leave the ends of their segments: parabolas of that sag and advance."""
    turns = np.maximum(4 * sag - advance, 0) / np.maximum(4 * sag, np.finfo(float).tiny)
    return sag * turns**2


def _gaps(ends: Floats) -> Floats:
    """Segments (g, 2, 2) from ends of pcurves (n, 2, 2) to the starts beside them.

    A ray through a gap would take all points of its line for outside, or inside. The pcurves of a
    loop may be in any order.
    """
    if not len(ends):
        return ends
    off = np.linalg.norm(ends[:, None, 1] - ends[None, :, 0], axis=2)
    nearest = np.argmin(off, axis=1)
    least = off[np.arange(len(ends)), nearest]
    open_ = (least > 0) & (least < _GAP * np.ptp(ends, axis=(0, 1)).max())
    return np.stack([ends[open_, 1], ends[nearest[open_], 0]], axis=1)


def _odd(segments: Floats, points: Floats) -> Bools:
    """(n,) whether a ray along u from each point crosses an odd number of segments."""
    (u0, v0), (u1, v1) = segments[:, 0].T, segments[:, 1].T
    u, v = points[:, :1], points[:, 1:]
    spans = (v0 <= v) != (v1 <= v)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = u0 + (v - v0) * ((u1 - u0) / (v1 - v0))
    odd: Bools = (spans & (crossing > u)).sum(axis=1) % 2 == 1
    return odd
