"""Further cuts that keep surfaces well-behaved: short continuations, positive weights.

A patch's rectangle may reach parts of its plane that have left the slab; there the surface is the
slab's polynomial continued. Continued far it loses digits, throws control points away from the
solid, and where it is rational its weights fall to zero and below.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import CheckError
from ffdcli.surface.cut import CutRule, split
from ffdcli.surface.graph import Graphs
from ffdcli.surface.partition import Partition, connect
from ffdcli.surface.patches import PatchBatch, plan_patches
from ffdcli.surface.planes import PlaneGroups
from ffdcli.surface.tolerance import Tolerances
from ffdcli.volume.protocol import Volume

# Surface weights keep at least this share of the least weight of the volume. The true weight
# function never falls below that, so halving reaches any smaller share.
_WEIGHT_SHARE = 0.1
# Share of the size by which such a cut may pass beside a vertex that is taken as lying on it.
_FREE_REACH = 1e-4
# Halvings after which a patch is smaller than any model needs.
_MOST_ROUNDS = 60


def keep_overshoot_small(
    parts: Partition,
    groups: PlaneGroups,
    graphs: Graphs,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
    *,
    shared: bool,
) -> Partition:
    """Cut long diagonal strips until their rectangles leave the slab by less than its thickness.

    The cuts are knots of b or c, else dyadic points between knots, so that neighbours tend to be
    cut at the same places. ``shared`` is as for :func:`connect`.
    """
    while True:
        rows = np.arange(len(parts.group))
        a = graphs.axes[parts.group, 0]
        middle = (parts.low + parts.high) / 2
        bounds = _cell_bounds(parts, volumes)
        floor, ceiling = bounds[rows, 0, a], bounds[rows, 1, a]
        b, c = graphs.axes[parts.group, 1], graphs.axes[parts.group, 2]
        centre = graphs.height(parts.group, middle[rows, b], middle[rows, c])
        reach = _lift(parts, graphs).sum(axis=1) / 2
        beyond = np.maximum(centre + reach - ceiling, floor - (centre - reach))
        sloping = graphs.sloping[parts.group].all(axis=1)
        far = parts.inside & sloping & (beyond >= ceiling - floor)
        if not far.any():
            return parts
        halved = _halve(parts, far, groups, graphs, volumes, tolerances, shared=shared)
        if len(halved.group) == len(parts.group):
            # Strips too thin to cut further: what they overshoot by costs digits only.
            return parts
        parts = halved


def keep_weights_positive(
    parts: Partition,
    groups: PlaneGroups,
    graphs: Graphs,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
    *,
    shared: bool,
) -> tuple[Partition, tuple[PatchBatch, ...]]:
    """Halve rational patches until all their weights are positive; also plan the patches.

    CAD kernels refuse weights that are not. Where the volume is polynomial nothing is cut.

    Raises
    ------
    CheckError
        Halving does not end, which rounding alone can cause.
    """
    batches = plan_patches(parts, graphs, volumes, tolerances)
    for _ in range(_MOST_ROUNDS):
        bad = np.zeros(len(parts.group), dtype=bool)
        for batch in batches:
            volume = volumes[batch.zone]
            if not volume.net_kind.rational:
                continue
            least = _WEIGHT_SHARE * volume.least_weight(batch.cells)
            found = batch.weights(volume.net, np.arange(len(batch.patches)))
            bad[batch.patches] = found.min(axis=(1, 2, 3)) < least
        if not bad.any():
            return parts, batches
        halved = _halve(parts, bad, groups, graphs, volumes, tolerances, shared=shared)
        if len(halved.group) == len(parts.group):
            break
        parts = halved
        batches = plan_patches(parts, graphs, volumes, tolerances)
    raise CheckError("the weights of some surface stay negative however finely it is cut")


def _cell_bounds(parts: Partition, volumes: Sequence[Volume]) -> Floats:
    """(Q, 2, 3) corners of the polynomial cell in the middle of each patch that is in a box."""
    bounds = np.stack([parts.low, parts.high], axis=1)
    middle = (parts.low + parts.high) / 2
    for number, volume in enumerate(volumes):
        mine = parts.zone == number
        bounds[mine] = volume.cell_bounds(volume.cells(middle[mine]))
    return bounds


def _lift(parts: Partition, graphs: Graphs) -> Floats:
    """(Q, 2) rise of each patch's plane along b and along c over its rectangle."""
    rows = np.arange(len(parts.group))[:, None]
    extent = (parts.high - parts.low)[rows, graphs.axes[parts.group, 1:]]
    return np.asarray(np.abs(graphs.slopes[parts.group]) * extent)


def _halve(
    parts: Partition,
    chosen: Bools,
    groups: PlaneGroups,
    graphs: Graphs,
    volumes: Sequence[Volume],
    tolerances: Tolerances,
    *,
    shared: bool,
) -> Partition:
    """Cut the chosen patches near the middle, across the direction in which they rise most."""
    lift = _lift(parts, graphs)
    rows = np.arange(len(lift))[:, None]
    flat = graphs.axes[parts.group, 1:]
    extent = (parts.high - parts.low)[rows, flat]
    # Where a patch does not rise at all its longer side is halved.
    level = (lift == 0).all(axis=1, keepdims=True)
    along = flat[rows[:, 0], np.argmax(np.where(level, extent, lift), axis=1)]
    axis = np.where(chosen, along, -1)
    bounds = _cell_bounds(parts, volumes)
    value = np.zeros(len(axis))
    boxes = np.stack([parts.low, parts.high], axis=1)
    for number, d in np.unique(np.column_stack([parts.zone, axis])[chosen], axis=0).tolist():
        members = np.flatnonzero(chosen & (axis == d) & (parts.zone == number))
        knots = volumes[number].knot_planes(d, boxes[members]).values
        for q, row in zip(members.tolist(), knots, strict=True):
            value[q] = _cut_place(parts.low[q, d], parts.high[q, d], row, bounds[q, :, d])

    # Both sides are one surface, so it makes no difference on which of them a vertex counts.
    shortest = tolerances.shortest_edge
    rule = CutRule(snap=2 * shortest, chord=shortest, reach=_FREE_REACH * tolerances.size)
    pieces = parts.pieces
    patch = parts.patch[parts.region]
    above = np.zeros(pieces.count, dtype=bool)
    column = 3 * parts.zone + axis
    for d, at in np.unique(np.column_stack([column, value])[chosen], axis=0):
        wanted = chosen & (column == d) & (value == at)
        pieces, cut = split(pieces, int(d), float(at), rule, wanted[patch])
        patch = np.concatenate([patch, patch[cut]])
        above = np.concatenate([above, above[cut]])
        lowest, highest = pieces.bounds(int(d))
        above |= wanted[patch] & ((lowest + highest) / 2 > at)
    _, cell = np.unique(np.column_stack([patch, above]), axis=0, return_inverse=True)
    return connect(pieces, groups, parts.zone[patch], cell.reshape(-1), shared=shared)


def _cut_place(low: float, high: float, knots: Floats, cell: Floats) -> float:
    """A knot in the middle half of [low, high], else the cell's coarsest dyadic point there."""
    middle, quarter = (low + high) / 2, (high - low) / 4
    near = knots[np.abs(knots - middle) <= quarter]
    if len(near):
        return float(near[np.argmin(np.abs(near - middle))])
    step = float(cell[1] - cell[0])
    while step > 2 * quarter:
        step /= 2
    return float(cell[0] + np.rint((middle - cell[0]) / step) * step)
