"""Further cuts of a partition that keep continuations short and surface weights positive.

The rectangle of a patch may reach parts of its plane outside its slab, where the surface is the
continued polynomial of the slab. Far continuations lose digits and move control points away from
the solid, and the weights of rational ones fall to 0 and below. How far is too far depends on the
knots: between two close ones a polynomial may be continued by many times their distance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffdcli.arrays import Bools, Floats, distinct_rows
from ffdcli.errors import CheckError, LatticeError
from ffdcli.surface.affine import find_affine, plan_cells
from ffdcli.surface.cut import CutPlane, CutRule, split
from ffdcli.surface.partition import Partition, connect
from ffdcli.surface.patches import plan_patches
from ffdcli.surface.spline_batch import SurfaceBatch

# Surface weights keep at least this share of the least weight of the volume. The weight function
# itself never falls below that least weight, so halving reaches this share.
_WEIGHT_SHARE = 0.1
# Largest growth of displacements and rounding errors of control points by continuation: what moves
# a control point by d moves that of a surface by up to 16 d, and 1.2 digits are lost.
MOST_GROWTH = 16.0
# Expected numbers of faces made by these cuts that are worth a warning, and that are refused.
_MANY_FACES, _MOST_FACES = 200, 20_000
# Pairs of knots named in that warning.
_NAMED = 3
# Share of the size within which a vertex may count as lying on such a cut.
_FREE_REACH = 1e-4
# Halvings after which a patch is smaller than any model needs.
_MOST_ROUNDS = 60


def keep_overshoot_small(
    parts: Partition, *, spare_planes: bool = False, warn: Callable[[str], None] | None = None
) -> tuple[Partition, tuple[str, ...], bool]:
    """Cut long diagonal strips until continuation keeps their control points near.

    The cuts are at knots of b or c, else at dyadic points between knots, so that neighbours tend
    to be cut at the same places.

    Parameters
    ----------
    parts : Partition
    spare_planes : bool
        Leave patches whole that the volumes, with their present nets, leave planes: these have no
        control points. Another net may bend them.
    warn : callable, optional
        Called with the warning before any cut is made.

    Returns
    -------
    Partition
    tuple of str
        A warning where hundreds of faces are to be expected from this.
    bool
        Whether the cuts depend on the present nets: some strips are cut only if they are no planes.

    Raises
    ------
    LatticeError
        More faces are to be expected than ``_MOST_FACES``.
    """
    warnings: tuple[str, ...] | None = None
    depends = False
    while True:
        wanted = _pieces_wanted(parts)
        far = wanted >= 1
        if spare_planes and far.any():
            cells = plan_cells(plan_patches(parts), parts)
            far &= ~find_affine(parts.facets.volumes, cells, len(far)).affine
            depends = True
        if warnings is None:
            warnings = _foresee(parts, np.where(far, wanted, 0.0))
            if warn is not None and warnings:
                warn(warnings[0])
        if not far.any():
            return parts, warnings, depends
        halved = _halve(parts, far)
        if len(halved.group) == len(parts.group):
            # These strips are too thin to cut further; their overshoot costs digits only.
            return parts, warnings, depends
        parts = halved


def _foresee(parts: Partition, wanted: Floats) -> tuple[str, ...]:
    """Warn of cuts into hundreds of faces, with the knots that make them needed; refuse more."""
    expected = int(np.ceil(wanted).sum())
    if expected <= _MANY_FACES:
        return ()
    volumes, axis, bounds = parts.facets.volumes, parts.graphs.axes[:, 0], _cell_bounds(parts)
    ends = bounds[np.arange(len(axis)), :, axis]
    rows = np.column_stack([parts.zone, axis, ends])
    slabs, slab = np.unique(rows, axis=0, return_inverse=True)
    pieces = np.bincount(slab.reshape(-1), wanted)
    named = []
    for worst in np.argsort(-pieces, kind="stable")[:_NAMED]:
        if pieces[worst] < pieces.max() / 10:
            break
        zone, d = slabs[worst, :2].astype(int)
        box = volumes[zone].box[:, d]
        low, high = (slabs[worst, 2:] - box[0]) / (box[1] - box[0])
        which = f" of lattices[{zone}]" if len(volumes) > 1 else ""
        named.append(f"{low:.9g} and {high:.9g} of {'uvw'[d]}{which}")
    message = (
        f"between the knots {', '.join(named)} (shares of the box) faces are so narrow that they "
        f"must be cut into about {expected:,} pieces"
    )
    if expected > _MOST_FACES:
        raise LatticeError(
            f"{message}; {_MOST_FACES:,} are allowed",
            hint="move these knots apart, or make them one knot of higher multiplicity",
        )
    return (message,)


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


def _pieces_wanted(parts: Partition) -> Floats:
    """(Q,) number of pieces that patches should fall into, by estimate; below 1 for good ones.

    Rectangles that leave the cell of their patch by less than the cell's own thickness are good.
    Beyond that they are judged by the growth of the continued polynomial, which rises with the
    power of the degree.
    """
    bounds = _cell_bounds(parts)
    middle = (parts.low + parts.high) / 2
    chosen = parts.inside
    if parts.rectangles is not None:
        corners = parts.rectangles.corners
        low, high = corners.min(axis=1), corners.max(axis=1)
    else:
        # The surface of a graph is continued along a alone.
        rows, graphs = np.arange(len(parts.group)), parts.graphs
        a, b, c = graphs.axes.T
        low, high = middle.copy(), middle.copy()
        centre = graphs.height(rows, middle[rows, b], middle[rows, c])
        reach = _lift(parts).sum(axis=1) / 2
        low[rows, a], high[rows, a] = centre - reach, centre + reach
        chosen = chosen & graphs.sloping.all(axis=1)
    thick = bounds[:, 1] - bounds[:, 0]
    beyond = np.maximum(high - bounds[:, 1], bounds[:, 0] - low) >= thick
    wanted = np.zeros(len(middle))
    for number, volume in enumerate(parts.facets.volumes):
        mine = np.flatnonzero(chosen & beyond.any(axis=1) & (parts.zone == number))
        if len(mine):
            cells = volume.cells(middle[mine])
            growth = volume.restrict(cells, low[mine], high[mine]).growth
            wanted[mine] = (growth / MOST_GROWTH) ** (1 / (beyond[mine] @ volume.degrees))
    return wanted


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
