"""Curves of edges: exact images of straight segments, B-splines on [0, 1].

The degree is the sum of the volume's degrees over the axes along which the segment runs, and the
breaks are where the segment crosses knot planes (docs/design.md, "Edges and topology").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.composition import merge_variables
from ffdcli.surface.spline_batch import SplineBatch, plan_joints
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume

# Weights of curves keep at least this share of the smallest lattice weight.
_WEIGHT_SHARE = 0.1


@dataclass(frozen=True, kw_only=True)
class EdgeBatch(SplineBatch):
    """Curves of edges in one box that run along the same axes; the parameter is in [0, 1].

    Parameters
    ----------
    edges : (m,) int64
    running : tuple of int
        The axes along which the edges run, at least one.
    """

    edges: Ints
    running: tuple[int, ...]

    def take(self, chosen: Ints) -> EdgeBatch:
        """The batch of the chosen curves alone."""
        index = self._boxes_of(chosen)
        return replace(
            self,
            edges=self.edges[chosen],
            breaks=(self.breaks[0][chosen],),
            joints=(self.joints[0].take(chosen),),
            restriction=self.restriction.take(index),
            ends=self.ends[index],
        )

    def _compose(self, points: Floats, index: Ints) -> Floats:
        # An axis across which the edge runs contributes one point, the others their degree.
        across = tuple(slice(None) if axis in self.running else 0 for axis in range(3))
        points = points[(slice(None), *across)]
        while points.ndim > 3:
            points = merge_variables(points, 1, 2)
        return points


def plan_curves(
    vertices: Floats,
    edges: Ints,
    zone: Ints,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
) -> tuple[EdgeBatch, ...]:
    """Breaks and boxes of the edges inside lattice boxes, grouped by pattern.

    Parameters
    ----------
    vertices : (V, n, 3) float64
        Coordinates in the frames of the n volumes.
    edges : (E, 2) int64
    zone : (E,) int64
        The volume in whose box each edge lies, -1 for none.
    volumes : sequence of Volume
    tolerances : Tolerances
        An edge runs along an axis where its ends differ by more than epsilon. Crossings nearer
        to each other than epsilon count as one, and those within snap of an end as none.
    """
    batches: list[EdgeBatch] = []
    for number, volume in enumerate(volumes):
        chosen = np.flatnonzero(zone == number)
        start, end = vertices[edges[chosen, 0], number], vertices[edges[chosen, 1], number]
        rise = np.abs(end - start)
        runs = rise > tolerances.epsilon
        runs |= ~runs.any(axis=1, keepdims=True) & (rise == rise.max(axis=1, keepdims=True))
        for row in np.unique(runs, axis=0):
            members = np.flatnonzero((runs == row).all(axis=1))
            p, q = start[members], end[members]
            # Across the other axes the curve lies halfway; both ends are within epsilon of it.
            p[:, ~row] = q[:, ~row] = (p[:, ~row] + q[:, ~row]) / 2
            running = tuple(np.flatnonzero(row).tolist())
            segments = _Segments(number, chosen[members], running, p, q)
            batches += _plan_segments(segments, volume, tolerances)
    return tuple(batches)


@dataclass(frozen=True)
class _Segments:
    """Edges (m,) in the box of one volume along the same axes, from start (m, 3) to end (m, 3)."""

    zone: int
    edges: Ints
    running: tuple[int, ...]
    start: Floats
    end: Floats

    def take(self, chosen: Ints) -> _Segments:
        """The chosen edges alone."""
        edges, start, end = self.edges[chosen], self.start[chosen], self.end[chosen]
        return replace(self, edges=edges, start=start, end=end)


def _plan_segments(segments: _Segments, volume: Volume, tolerances: Tolerances) -> list[EdgeBatch]:
    """Batches of edges along the same axes, one for each pattern of multiplicities."""
    degree = volume.net_kind.degree(sum(volume.degrees[axis] for axis in segments.running))
    values, mults = _crossings(segments, degree, volume, tolerances)
    patterns, which = np.unique(mults, axis=0, return_inverse=True)
    batches: list[EdgeBatch] = []
    for number, pattern in enumerate(patterns):
        part = np.flatnonzero(which.reshape(-1) == number)
        used = pattern > 0
        ends = np.zeros(len(part))
        breaks = np.column_stack([ends, values[part][:, used], ends + 1])
        batch = _plan_batch(segments.take(part), degree, breaks, pattern[used], volume)
        batches += _keep_weights_positive(batch, volume)
    return batches


def _keep_weights_positive(batch: EdgeBatch, volume: Volume) -> list[EdgeBatch]:
    """Separate the rational curves whose joined pieces have weights that are not positive.

    Each piece alone has positive weights, since it stays in its cell. So these curves keep all
    control points of their pieces, with knots of full multiplicity.
    """
    if not volume.net_kind.rational:
        return [batch]
    lowest = batch.weights(volume.net, np.arange(batch.count)).min(axis=(1, 2))
    bad = lowest < _WEIGHT_SHARE * volume.least_weight(volume.cells(batch.ends.mean(axis=1)))
    mults = (np.full_like(batch.mults[0], batch.degrees[0]),)
    joints = plan_joints(batch.breaks, mults, batch.degrees)
    unjoined = replace(batch, mults=mults, joints=joints)
    parts = ((batch, np.flatnonzero(~bad)), (unjoined, np.flatnonzero(bad)))
    return [one.take(rows) for one, rows in parts if len(rows)]


def _crossings(
    segments: _Segments, degree: int, volume: Volume, tolerances: Tolerances
) -> tuple[Floats, Ints]:
    """Parameters (m, n) where edges cross knot planes, rising, with multiplicities (0: none)."""
    start, end = segments.start, segments.end
    length = np.linalg.norm(end - start, axis=1)
    boxes = np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1)
    values, mults = [], []
    for axis in segments.running:
        planes = volume.knot_planes(axis, boxes)
        low = np.minimum(start[:, axis], end[:, axis])[:, None]
        high = np.maximum(start[:, axis], end[:, axis])[:, None]
        snap = tolerances.snap(planes.continuity)
        crossed = (planes.values > low + snap) & (planes.values < high - snap)
        rise = (end[:, axis] - start[:, axis])[:, None]
        at = (planes.values - start[:, axis, None]) / rise
        values.append(np.where(crossed, at, np.inf))
        mults.append(np.where(crossed, degree - planes.continuity, 0))
    value, mult = np.concatenate(values, axis=1), np.concatenate(mults, axis=1)
    rank = np.argsort(value, axis=1, kind="stable")
    value, mult = np.take_along_axis(value, rank, axis=1), np.take_along_axis(mult, rank, axis=1)
    used = mult.any(axis=0)
    value, mult = value[:, used], mult[:, used]
    # Where an edge crosses several planes at one parameter, the lowest continuity counts.
    for i in range(1, value.shape[1]):
        with np.errstate(invalid="ignore"):
            meets = (value[:, i] - value[:, i - 1]) * length <= tolerances.epsilon
        meets &= mult[:, i] > 0
        mult[:, i] = np.where(meets, np.maximum(mult[:, i], mult[:, i - 1]), mult[:, i])
        mult[:, i - 1] = np.where(meets, 0, mult[:, i - 1])
    value = np.where(mult > 0, value, np.inf)
    rank = np.argsort(value, axis=1, kind="stable")
    return np.take_along_axis(value, rank, axis=1), np.take_along_axis(mult, rank, axis=1)


def _plan_batch(
    segments: _Segments, degree: int, breaks: Floats, mults: Ints, volume: Volume
) -> EdgeBatch:
    """The batch of edges that share degree and multiplicities."""
    start, end = segments.start, segments.end
    at = start[:, None, :] + breaks[:, :, None] * (end - start)[:, None, :]
    at[:, -1] = end
    first, last = at[:, :-1].reshape(-1, 3), at[:, 1:].reshape(-1, 3)
    cells = volume.cells((first + last) / 2)
    return EdgeBatch(
        zone=segments.zone,
        edges=segments.edges,
        running=segments.running,
        degrees=(degree,),
        breaks=(breaks,),
        mults=(mults,),
        joints=plan_joints([breaks], [mults], [degree]),
        restriction=volume.restrict(cells, first, last),
        ends=np.stack([first, last], axis=1),
        net_kind=volume.net_kind,
    )
