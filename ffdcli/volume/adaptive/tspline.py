"""Weighted T-spline volumes on an octree, or on cells given (Song & Yang 2005).

The corners of the cells are the control points. Each has a product of cubic B-splines, whose knots
are read off the lattice by rays (section 3.2.2), and a weight: large at cells that hold part of the
model, small elsewhere. The functions do not add up to 1; their weighted quotients do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.adaptive.local_functions import LocalFunctions
from ffdcli.volume.adaptive.octree import Cells, ModelTree
from ffdcli.volume.adaptive.polynomial_cells import polynomial_cells
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame

DEGREES = (3, 3, 3)

# Lower bound of sums of weighted functions, as a share of the least weight.
_POSITIVE = 1e-9
# Largest number of polynomial cells of given cells: their functions take some 10 s.
MAX_PIECES = 300_000
# Polynomial cells treated together: bounds the memory.
_CHUNK = 5_000


def tspline_volume(
    model: ModelTree[Cells], box: Floats, weights: tuple[float, float], frame: Frame
) -> AdaptiveVolume:
    """The volume at rest, embedded by displacement: ``D(x) = x + P(x) - P0(x)``.

    Parameters
    ----------
    model : ModelTree
    box : (2, 3) float64, lattice frame
    weights : (float, float)
        Weights of the control points of cells that hold part of the model, and of the others.
    frame : Frame

    Raises
    ------
    TooManyPieces
        Given cells need more than :data:`MAX_PIECES` polynomial cells.
    """
    tree = model.tree
    unit = (box[1] - box[0]) / tree.counts
    u, v, w = (ray_knots(tree, tree.corners, axis) for axis in range(3))
    exposed = np.zeros(len(tree.corners), dtype=bool)
    exposed[tree.leaf_corners[model.full]] = True
    level = np.zeros(len(tree.corners), dtype=np.int64)
    np.maximum.at(level, tree.leaf_corners, tree.levels[:, None])
    rest_weights = np.where(exposed, *weights)
    depth = int(tree.counts.max() - 1).bit_length()
    most = MAX_PIECES if tree.as_octree is None else None
    cells = polynomial_cells((u, v, w), depth, most)
    return AdaptiveVolume(
        functions=LocalFunctions(DEGREES, (u, v, w), cells),
        rest_points=box[0] + tree.corners * unit,
        rest_weights=rest_weights,
        levels=level,
        hidden=~exposed,
        net=np.column_stack([np.zeros((len(level), 3)), rest_weights]),
        origin=box[0],
        unit=unit,
        box=box,
        frame=frame,
        weighted=True,
    )


def thin_place(volume: AdaptiveVolume) -> Floats | None:
    """Corners (2, 3) of a polynomial cell on which the functions' weighted sum may vanish, if any.

    The paper requires a positive sum everywhere (section 3.2.1), which the rules of T-lattices do
    not ensure: knots may lie so close around a long cell that the functions of its corners end
    inside it. Here all Bernstein coefficients of the sum must be positive, which is slightly
    stronger: surfaces get their weights from them.
    """
    tree = volume.functions.tree
    middle = volume.origin + (tree.low + tree.size[:, None] / 2) * volume.unit
    inside = tree.low[volume.contains(middle)]
    for start in range(0, len(inside), _CHUNK):
        part = inside[start : start + _CHUNK]
        bounds = volume.cell_bounds(part)
        # Lists of the functions of each cell, which a volume keeps, are not needed again.
        volume = replace(volume, functions=replace(volume.functions))
        forms = volume.restrict(part, bounds[:, 0], bounds[:, 1])
        sums = forms.apply(volume.rest_weights[:, None]).reshape(len(part), -1)
        thin = np.flatnonzero(sums.min(axis=1) <= _POSITIVE * volume.rest_weights.min())
        if len(thin):
            return np.asarray(bounds[thin[sums[thin].max(axis=1).argmin()]])
    return None


def ray_knots(tree: Cells, corners: Ints, axis: int) -> Ints:
    """Knots (n, 5) along an axis of the functions of corners (n, 3).

    Two on either side of the corner: where a ray along the axis meets closed leaf faces normal to
    it. Where the ray leaves the box before, the last interval is repeated.
    """
    ahead = _steps(tree, corners, axis, 1)
    behind = _steps(tree, corners, axis, -1)
    # At a corner on a side of the box the interval on the inside is repeated.
    ahead = np.where(ahead < 0, np.stack([behind[:, 0]] * 2, axis=1), ahead)
    behind = np.where(behind < 0, np.stack([ahead[:, 0]] * 2, axis=1), behind)
    middle = corners[:, axis]
    return np.stack(
        [
            middle - behind.sum(axis=1),
            middle - behind[:, 0],
            middle,
            middle + ahead[:, 0],
            middle + ahead.sum(axis=1),
        ],
        axis=-1,
    )


def _steps(tree: Cells, corners: Ints, axis: int, way: int) -> Ints:
    """First two intervals (n, 2) along a ray; -1 where it starts at the side of the box."""
    first = _interval(tree, corners, axis, way)
    at = corners.copy()
    at[:, axis] += way * np.maximum(first, 0)
    second = _interval(tree, at, axis, way)
    return np.stack([first, np.where(second < 0, first, second)], axis=-1)


def _interval(tree: Cells, corners: Ints, axis: int, way: int) -> Ints:
    """Distance (n,) to the next face across a ray; -1 where it leaves the box at once."""
    counts = tree.counts
    others = [(axis + 1) % 3, (axis + 2) % 3]
    beyond = counts[axis] + 1
    nearest = np.full(len(corners), beyond)
    ahead = corners[:, axis] if way > 0 else corners[:, axis] - 1
    # A ray along cell edges can meet only closed faces of the four cells around it.
    for i in (0, -1):
        for j in (0, -1):
            cell = np.empty_like(corners)
            cell[:, axis] = ahead
            cell[:, others[0]] = corners[:, others[0]] + i
            cell[:, others[1]] = corners[:, others[1]] + j
            here = np.flatnonzero(np.all((cell >= 0) & (cell < counts), axis=1))
            leaf = tree.locate(cell[here])
            face = (tree.high if way > 0 else tree.low)[leaf, axis]
            nearest[here] = np.minimum(nearest[here], np.abs(face - corners[here, axis]))
    return np.where(nearest == beyond, -1, nearest)
