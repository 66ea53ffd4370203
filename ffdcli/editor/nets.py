"""What is drawn of lattices: control points with their lines, and octree cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.view.deformation_scene import drawn_net


@dataclass(frozen=True, eq=False)
class Net:
    """Control points of a lattice.

    Parameters
    ----------
    points, rest : (m, 3) float64, model length
        As they are, and before any edit.
    lines : (k, 2) int64
        Pairs of neighbours; none on octrees.
    locked : (m,) bool
        Fixed by the continuity at sides that the model crosses.
    hidden : (m,) bool
        Of empty cells of an octree: drawn on request only.
    closed : (m,) bool
        Edits name these only with `hidden: true`.
    shape : tuple of int
        Numbers of control points along u, v, w; one number on octrees.
    """

    points: Floats
    rest: Floats
    lines: Ints
    locked: Bools
    hidden: Bools
    closed: Bools
    shape: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of control points."""
        return len(self.points)

    @property
    def free(self) -> Bools:
        """(m,) True for control points that edits may move."""
        return ~(self.locked | self.closed)


def net_of(lattice: BoxLattice) -> Net:
    """The control points of a lattice."""
    drawn = drawn_net(lattice, np.array([1.0]))
    frame, rest = lattice.map.frame, lattice.control.at_rest
    return Net(
        points=frame.to_model(lattice.points.reshape(-1, 3)),
        rest=frame.to_model(rest.rest_points.reshape(-1, 3)),
        lines=drawn.lines,
        locked=drawn.locked,
        hidden=drawn.hidden,
        closed=lattice.start.hidden.ravel(),
        shape=lattice.points.shape[:-1],
    )


def slice_mask(net: Net, lattice: BoxLattice, axis: int, index: int) -> Bools:
    """(m,) control points of one layer across an axis, by its number or that of one of them.

    On an octree those whose places at rest have the same value along the axis as control point
    ``index``.
    """
    places = lattice.control.at_rest.rest_points
    if places.ndim == 4:
        mask = np.zeros(net.shape, dtype=bool)
        np.moveaxis(mask, axis, 0)[index] = True
        return mask.ravel()
    values = places[:, axis]
    near = np.abs(values - values[index]) <= 1e-9 * np.ptp(values)
    return np.asarray(near & ~net.closed)


def near_mask(net: Net, origin: Floats, direction: Floats, radius: float) -> Bools:
    """(m,) the first control point that a ray passes within a radius; or none."""
    towards = direction / np.linalg.norm(direction)
    arm = net.points - origin
    along = arm @ towards
    off = np.linalg.norm(arm - along[:, None] * towards, axis=1)
    hit = np.flatnonzero((off <= radius) & (along > 0) & ~net.closed)
    mask = np.zeros(net.count, dtype=bool)
    if len(hit):
        mask[hit[np.argmin(along[hit])]] = True
    return mask
