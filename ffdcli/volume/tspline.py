"""Weighted T-spline volumes on an octree (Song & Yang 2005).

The corners of the octree's cells are the control points. Each has a product of cubic B-splines,
whose knots are read off the lattice by rays (section 3.2.2), and a weight: those of cells that hold
part of the model are heavy, the others light. The functions do not add up to 1; their weighted
quotients do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffdcli.volume.adaptive import AdaptiveVolume
from ffdcli.volume.frame import Frame
from ffdcli.volume.functions import LocalFunctions, polynomial_cells
from ffdcli.volume.octree import ModelTree, Octree

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

DEGREES = (3, 3, 3)


def tspline_volume(
    model: ModelTree, box: Floats, weights: tuple[float, float], frame: Frame
) -> AdaptiveVolume:
    """The volume at rest, embedded by displacement: ``D(x) = x + P(x) - P0(x)``.

    Parameters
    ----------
    model : ModelTree
    box : (2, 3) float64, lattice frame
    weights : (float, float)
        Of the control points of cells that hold part of the model, and of the others.
    frame : Frame
    """
    tree = model.tree
    unit = (box[1] - box[0]) / (1 << tree.depth)
    u, v, w = (ray_knots(tree, tree.corners, axis) for axis in range(3))
    exposed = np.zeros(len(tree.corners), dtype=bool)
    exposed[tree.leaf_corners[model.full]] = True
    level = np.zeros(len(tree.corners), dtype=np.int64)
    np.maximum.at(level, tree.leaf_corners, tree.levels[:, None])
    rest_weights = np.where(exposed, *weights)
    cells = polynomial_cells((u, v, w), tree.depth)
    return AdaptiveVolume(
        functions=LocalFunctions(DEGREES, (u, v, w), cells),
        rest_points=box[0] + tree.corners * unit,
        rest_weights=rest_weights,
        level=level,
        hidden=~exposed,
        net=np.column_stack([np.zeros((len(level), 3)), rest_weights]),
        origin=box[0],
        unit=unit,
        box=box,
        frame=frame,
        weighted=True,
    )


def ray_knots(tree: Octree, corners: Ints, axis: int) -> Ints:
    """Knots (n, 5) along an axis of the functions of corners (n, 3).

    Two on either side of the corner: the places where a ray meets a closed leaf face across it.
    Where it leaves the box before, the last interval is repeated.
    """
    ahead = _steps(tree, corners, axis, 1)
    behind = _steps(tree, corners, axis, -1)
    # A corner on a side of the box has nothing beyond; the interval on its inside is repeated.
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


def _steps(tree: Octree, corners: Ints, axis: int, way: int) -> Ints:
    """First two intervals (n, 2) along a ray; -1 where it starts at the side of the box."""
    first = _interval(tree, corners, axis, way)
    at = corners.copy()
    at[:, axis] += way * np.maximum(first, 0)
    second = _interval(tree, at, axis, way)
    return np.stack([first, np.where(second < 0, first, second)], axis=-1)


def _interval(tree: Octree, corners: Ints, axis: int, way: int) -> Ints:
    """Distance (n,) to the next face across a ray; -1 where it leaves the box at once."""
    top = 1 << tree.depth
    others = [(axis + 1) % 3, (axis + 2) % 3]
    nearest = np.full(len(corners), top + 1)
    ahead = corners[:, axis] if way > 0 else corners[:, axis] - 1
    live = (ahead >= 0) & (ahead < top)
    # The closed faces that a ray along cell edges can meet are those of the four cells round it.
    for i in (0, -1):
        for j in (0, -1):
            cell = np.empty_like(corners)
            cell[:, axis] = ahead
            cell[:, others[0]] = corners[:, others[0]] + i
            cell[:, others[1]] = corners[:, others[1]] + j
            here = np.flatnonzero(live & np.all((cell >= 0) & (cell < top), axis=1))
            leaf = tree.locate(cell[here])
            face = tree.low[leaf, axis] + (tree.size[leaf] if way > 0 else 0)
            nearest[here] = np.minimum(nearest[here], np.abs(face - corners[here, axis]))
    return np.where(nearest > top, -1, nearest)
