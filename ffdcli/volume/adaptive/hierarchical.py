"""Hierarchical volumes: B-spline displacement lattices on the nested dyadic grid of an octree.

``D(x) = x + sum over levels of sum_i delta_i N_i(x)``. Each level is a uniform lattice whose cells
are half as large as those of the level before, and has only the functions near octree cells of that
level (docs/design.md, "Adaptive volumes").
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.adaptive.local_functions import LocalFunctions
from ffdcli.volume.adaptive.octree import Octree
from ffdcli.volume.adaptive.polynomial_cells import polynomial_cells
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame


def hierarchical_volume(
    tree: Octree, box: Floats, degrees: tuple[int, int, int], frame: Frame
) -> AdaptiveVolume:
    """The volume at rest on an octree.

    A level has the functions whose open supports meet a cell of that level; level 0, the whole box,
    has all its ``(k + 1)**3`` functions. Supports reach beyond the box, so the displacement fades
    out smoothly outside it.

    Parameters
    ----------
    tree : Octree
        Octree over the box.
    box : (2, 3) float64, lattice frame
    degrees : (int, int, int)
    frame : Frame
    """
    first, level = active_functions(tree, degrees)
    return volume_of_levels(first, level, tree.depth, box, degrees, frame)


def volume_of_levels(
    first: Ints, level: Ints, depth: int, box: Floats, degrees: tuple[int, int, int], frame: Frame
) -> AdaptiveVolume:
    """The volume at rest with chosen functions of each level.

    Parameters
    ----------
    first, level
        As :func:`active_functions` returns them.
    depth : int
        The deepest level allowed.
    box, degrees, frame
        As for :func:`hierarchical_volume`.
    """
    size = (1 << (depth - level))[:, None]
    # The octree of the polynomial cells holds all supports; those of level 0 reach furthest.
    more = int(np.ceil(np.log2(2 * max(degrees) + 1)))
    shift = max(degrees) << depth
    u, v, w = (
        (first[:, axis : axis + 1] + np.arange(degree + 2)) * size + shift
        for axis, degree in enumerate(degrees)
    )
    knots = (u, v, w)
    cells = polynomial_cells(knots, depth + more)
    unit = (box[1] - box[0]) / (1 << depth)
    origin = box[0] - shift * unit
    middle = np.stack([(t[:, 0] + t[:, -1]) / 2 for t in knots], axis=-1)
    reach = np.array(degrees) * (box[1] - box[0])
    return AdaptiveVolume(
        functions=LocalFunctions(degrees, knots, cells),
        rest_points=origin + middle * unit,
        rest_weights=np.ones(len(first)),
        levels=level,
        hidden=np.zeros(len(first), dtype=bool),
        net=np.zeros((len(first), 3)),
        origin=origin,
        unit=unit,
        box=np.stack([box[0] - reach, box[1] + reach]),
        frame=frame,
        weighted=False,
    )


def active_functions(tree: Octree, degrees: tuple[int, int, int]) -> tuple[Ints, Ints]:
    """Functions of all levels, sorted by level, then index, w fastest.

    Returns
    -------
    (n, 3) int64
        The first cell of each function's support, in units of its level; from -k_a on.
    (n,) int64
        Level.
    """
    firsts, levels = [], []
    leaf_level = tree.levels
    for level in range(tree.depth + 1):
        # Cells of the level are its leaves, and the ancestors of finer leaves.
        found = tree.low[leaf_level >= level] >> (tree.depth - level)
        width = (1 << level) + max(degrees) + 1
        shifted = found + max(degrees)
        keys = np.unique((shifted[:, 0] * width + shifted[:, 1]) * width + shifted[:, 2])
        for degree, stride in zip(degrees, (width * width, width, 1), strict=True):
            keys = np.unique(keys[:, None] - stride * np.arange(degree + 1))
        first = np.stack([keys // (width * width), keys // width % width, keys % width], axis=-1)
        firsts.append(first - max(degrees))
        levels.append(np.full(len(keys), level))
    return np.concatenate(firsts), np.concatenate(levels)
