"""Further cuts of a partition that keep continuations short and surface weights positive.

The rectangle of a patch may reach parts of its plane outside its slab, where the surface is the
continued polynomial of the slab. Far continuations lose digits and move control points away from
the solid, and the weights of rational ones fall to 0 and below.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, distinct_rows
from ffdcli.errors import CheckError
from ffdcli.surface.cut import CutPlane, CutRule, split
from ffdcli.surface.partition import Partition, connect
from ffdcli.surface.patches import plan_patches
from ffdcli.surface.spline_batch import SurfaceBatch

# Surface weights keep at least this share of the least weight of the volume. The weight function
# itself never falls below that least weight, so halving reaches this share.
_WEIGHT_SHARE = 0.1
# Share of the size within which a vertex may count as lying on such a cut.
_FREE_REACH = 1e-4
# Halvings after which a patch is smaller than any model needs.
_MOST_ROUNDS = 60


def keep_overshoot_small(parts: Partition) -> Partition:
    """Cut long diagonal strips until their rectangles leave the slab by less than its thickness.

    The cuts are at knots of b or c, else at dyadic points between knots, so that neighbours tend
    to be cut at the same places.
    """
    while True:
        far = parts.inside & _overshoot(parts)
        if not far.any():
            return parts
        halved = _halve(parts, far)
        if len(halved.group) == len(parts.group):
            # These strips are too thin to cut further; their overshoot costs digits only.
            return parts
        parts = halved


def keep_weights_positive(parts: Partition) -> tuple[Partition, tuple[SurfaceBatch, ...]]:
    """Halve rational patches until all their weights are positive; also plan the patches.

    CAD kernels reject weights that are not positive. Patches of polynomial volumes are not cut.

    Raises
    ------
    CheckError
        Some weight stays negative, which only rounding can cause.
    """
    batches = plan_patches(parts)
    for _ in range(_MOST_ROUNDS):
        bad = np.zeros(len(parts.group), dtype=bool)
        for batch in batches:
            volume = parts.facets.volumes[batch.zone]
            if not volume.net_kind.rational:
                continue
            least = _WEIGHT_SHARE * volume.least_weight(batch.cells)
            found = batch.weights(volume.net, np.arange(len(batch.patches)))
            bad[batch.patches] = found.min(axis=(1, 2, 3)) < least
        if not bad.any():
            return parts, batches
        halved = _halve(parts, bad)
        if len(halved.group) == len(parts.group):
            break
        parts = halved
        batches = plan_patches(parts)
    raise CheckError("the weights of some surface stay negative however finely it is cut")


def _overshoot(parts: Partition) -> Bools:
    """(Q,) True where a rectangle leaves the cell of its patch by the cell's own thickness."""
    bounds = _cell_bounds(parts)
    if parts.rectangles is not None:
        corners = parts.rectangles.corners
        above, below = corners.max(axis=1) - bounds[:, 1], bounds[:, 0] - corners.min(axis=1)
        return np.asarray((np.maximum(above, below) >= bounds[:, 1] - bounds[:, 0]).any(axis=1))
    rows, graphs = np.arange(len(parts.group)), parts.graphs
    a, b, c = graphs.axes.T
    middle = (parts.low + parts.high) / 2
    floor, ceiling = bounds[rows, 0, a], bounds[rows, 1, a]
    centre = graphs.height(rows, middle[rows, b], middle[rows, c])
    reach = _lift(parts).sum(axis=1) / 2
    beyond = np.maximum(centre + reach - ceiling, floor - (centre - reach))
    return np.asarray(graphs.sloping.all(axis=1) & (beyond >= ceiling - floor))


def _cell_bounds(parts: Partition) -> Floats:
    """(Q, 2, 3) corners of the polynomial cell at the middle of each patch in a lattice box."""
    bounds = np.stack([parts.low, parts.high], axis=1)
    middle = (parts.low + parts.high) / 2
    for number, volume in enumerate(parts.facets.volumes):
        mine = parts.zone == number
        bounds[mine] = volume.cell_bounds(volume.cells(middle[mine]))
    return bounds


def _lift(parts: Partition) -> Floats:
    """(Q, 2) rise of the plane of each patch along b and along c over its rectangle."""
    return np.asarray(np.abs(parts.graphs.slopes) * _extent(parts))


def _extent(parts: Partition) -> Floats:
    """(Q, 2) sides of the rectangle of each patch along b and c."""
    return np.take_along_axis(parts.high - parts.low, parts.graphs.axes[:, 1:], axis=1)


def _halve(parts: Partition, chosen: Bools) -> Partition:
    """Cut the chosen patches (Q,) near the middle, across the direction of their largest rise."""
    lift, extent = _lift(parts), _extent(parts)
    volumes, tolerances = parts.facets.volumes, parts.facets.tolerances
    # The longer side of a patch that does not rise is halved, or whose surface is no graph.
    level = (lift == 0).all(axis=1, keepdims=True) | (parts.rectangles is not None)
    across = 1 + np.argmax(np.where(level, extent, lift), axis=1)
    axis = np.where(chosen, parts.graphs.axes[np.arange(len(lift)), across], -1)
    bounds = _cell_bounds(parts)
    value = np.zeros(len(axis))
    boxes = np.stack([parts.low, parts.high], axis=1)
    for number, d in np.unique(np.column_stack([parts.zone, axis])[chosen], axis=0).tolist():
        members = np.flatnonzero(chosen & (axis == d) & (parts.zone == number))
        knots = volumes[number].knot_planes(d, boxes[members]).values
        for q, row in zip(members.tolist(), knots, strict=True):
            value[q] = _cut_place(parts.low[q, d], parts.high[q, d], row, bounds[q, :, d])

    # The volume is smooth there, so it does not matter to which side a near vertex belongs.
    shortest = tolerances.shortest_edge
    rule = CutRule(snap=2 * shortest, chord=shortest, reach=_FREE_REACH * tolerances.size)
    pieces = parts.pieces
    patch = parts.patch[parts.region]
    above = np.zeros(pieces.count, dtype=bool)
    planes = np.column_stack([parts.zone, axis, value])
    for row in np.unique(planes[chosen], axis=0):
        wanted = chosen & (planes == row).all(axis=1)
        plane = CutPlane(int(row[0]), int(row[1]), float(row[2]), rule)
        pieces, cut = split(pieces, plane, wanted[patch])
        patch = np.concatenate([patch, patch[cut]])
        above = np.concatenate([above, above[cut]])
        lowest, highest = pieces.bounds(plane.volume, plane.axis)
        above |= wanted[patch] & ((lowest + highest) / 2 > plane.value)
    _, cell = distinct_rows(np.column_stack([patch, above]))
    return connect(pieces, parts.facets, parts.zone[patch], cell)


def _cut_place(low: float, high: float, knots: Floats, cell: Floats) -> float:
    """A knot in the middle half of [low, high], else the coarsest dyadic point of the cell."""
    middle, quarter = (low + high) / 2, (high - low) / 4
    near = knots[np.abs(knots - middle) <= quarter]
    if len(near):
        return float(near[np.argmin(np.abs(near - middle))])
    step = float(cell[1] - cell[0])
    while step > 2 * quarter:
        step /= 2
    return float(cell[0] + np.rint((middle - cell[0]) / step) * step)
