"""Undeformed triangles with numbered edges, for splits and flips."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import number_sides


@dataclass(frozen=True)
class TriangleNet:
    """Triangles and their edges.

    Parameters
    ----------
    rest : (V, 3) float64, model length
        Undeformed vertices.
    triangles : (T, 3) int64
    sides : (T, 3) int64
        Edge from each corner to the next.
    ends : (E, 2) int64
        Vertices of each edge, in either order.
    owner : (T,) int64
        Flat face of each triangle.
    parents : (n, 2) int64
        Vertices that each of the last n vertices was made halfway between, by splits.
    """

    rest: Floats
    triangles: Ints
    sides: Ints
    ends: Ints
    owner: Ints
    parents: Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @cached_property
    def beside(self) -> Ints:
        """(E, 2) two of the sides (3 t + i) along each edge; -1 for a missing one."""
        flat = self.sides.ravel()
        order = np.argsort(flat, kind="stable")
        count = np.bincount(flat, minlength=len(self.ends))
        last = np.cumsum(count) - 1
        out = np.full((len(self.ends), 2), -1, dtype=np.int64)
        out[count > 0, 0] = order[last[count > 0]]
        out[count > 1, 1] = order[last[count > 1] - 1]
        return out

    @cached_property
    def inner(self) -> Bools:
        """(E,) edges between two triangles of one face, which can be flipped."""
        shared = (self.beside >= 0).all(axis=1)
        owner = self.owner[np.maximum(self.beside, 0) // 3]
        return np.asarray(shared & (owner[:, 0] == owner[:, 1]))


def net_of_triangles(rest: Floats, triangles: Ints, owner: Ints) -> TriangleNet:
    """The net of the triangles (T, 3) of flat faces."""
    sides = number_sides(triangles, owner, len(rest))
    heads = np.roll(triangles, -1, axis=1)
    ends = np.zeros((int(sides.max(initial=-1)) + 1, 2), dtype=np.int64)
    ends[sides] = np.sort(np.stack([triangles, heads], axis=-1), axis=-1)
    return TriangleNet(rest, triangles, sides, ends, owner)
