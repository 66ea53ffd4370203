"""T-lattices given cell by cell: boxes that tile a region (Song & Yang 2005, section 3.2.2).

The boxes have integer corners, in units that divide the region along each axis. Octrees are such
tilings too; here the sides need not be halves of one another.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Floats, Ints, gather_runs, run_starts
from ffdcli.volume.adaptive.octree import TOUCH, SharedCorners
from ffdcli.volume.convex_overlap import touches_boxes, unit_directions

# Grid cells between the planes of all sides, at most: bounds the memory of the table.
MAX_PLACES = 20_000_000
# Pairs of triangle and grid cell tested together: bounds the memory.
_CHUNK = 200_000


class BrokenRule(ValueError):
    """Boxes break a rule of T-lattices.

    Parameters
    ----------
    rule : int
        Number of the rule (Song & Yang 2005, section 3.2.2); 0 where planes are too many to test.
    cells : tuple of int
        The boxes that break it.
    place : (2, 3) int64, or None
        The part of the region concerned.
    """

    def __init__(self, rule: int, cells: tuple[int, ...] = (), place: Ints | None = None) -> None:
        super().__init__(f"rule {rule} of T-lattices is broken")
        self.rule = rule
        self.cells = cells
        self.place = place


@dataclass(frozen=True)
class TLattice(SharedCorners):
    """Boxes that tile the region from 0 to the highest corner; see :func:`tlattice`.

    Parameters
    ----------
    low, high : (N, 3) int64
        Corners of the boxes.
    """

    low: Ints
    high: Ints

    @cached_property
    def counts(self) -> Ints:
        """(3,) units along each axis of the region."""
        return np.asarray(self.high.max(axis=0))

    @cached_property
    def levels(self) -> Ints:
        """(N,) level of each box: the mean of log2(side of the region / side of the box)."""
        share = np.log2(self.counts / (self.high - self.low)).mean(axis=1)
        return np.floor(share + 1e-9).astype(np.int64)

    @cached_property
    def planes(self) -> tuple[Ints, Ints, Ints]:
        """Planes on which boxes end along each axis, increasing."""
        u, v, w = (np.union1d(self.low[:, a], self.high[:, a]) for a in range(3))
        return u, v, w

    @property
    def plane_counts(self) -> Ints:
        """(3,) planes across each axis on which boxes end."""
        return np.array([len(each) for each in self.planes])

    @property
    def as_octree(self) -> None:
        """None: the boxes were given one by one."""
        return None

    def locate(self, cells: Ints) -> Ints:
        """Box (m,) that holds each unit cell (m, 3) of the region, given by its low corner."""
        place = [
            np.searchsorted(planes, cells[:, axis], side="right") - 1
            for axis, planes in enumerate(self.planes)
        ]
        return self._owner[place[0], place[1], place[2]].astype(np.int64)

    @cached_property
    def _owner(self) -> NDArray[np.int32]:
        """Number of the box that holds each grid cell between planes."""
        numbers = np.arange(len(self.low), dtype=np.int32)
        return self._painted(numbers)

    @property
    def cover(self) -> NDArray[np.int32]:
        """Number of boxes that hold each grid cell between planes."""
        return self._painted(np.ones(len(self.low), dtype=np.int32))

    def _painted(self, values: NDArray[np.int32]) -> NDArray[np.int32]:
        """Sums of the values of the boxes that hold each grid cell between planes."""
        ends = [
            [np.searchsorted(planes, side[:, axis]) for side in (self.low, self.high)]
            for axis, planes in enumerate(self.planes)
        ]
        # Each box adds its value from its low sides on and subtracts it from its high sides on.
        out = np.zeros([len(planes) for planes in self.planes], dtype=np.int32)
        for i, u in enumerate(ends[0]):
            for j, v in enumerate(ends[1]):
                for k, w in enumerate(ends[2]):
                    np.add.at(out, (u, v, w), values if (i + j + k) % 2 == 0 else -values)
        for axis in range(3):
            np.cumsum(out, axis=axis, out=out)
        return out[:-1, :-1, :-1]

    def holding_points(self, points: Floats) -> Bools:
        """(N,) True for boxes that hold some of the points (m, 3), fractions of the region."""
        inside = points[np.all((points >= 0) & (points <= 1), axis=1)]
        cells = np.floor(inside * self.counts).astype(np.int64).clip(0, self.counts - 1)
        out = np.zeros(len(self.low), dtype=bool)
        out[self.locate(cells)] = True
        return out

    def touching_triangles(self, triangles: Floats) -> Bools:
        """(N,) True for boxes that touch triangles (T, 3, 3), fractions of the region."""
        corners = triangles * self.counts
        normals, edges = unit_directions(corners)
        lowest, highest = corners.min(axis=1), corners.max(axis=1)
        slack = TOUCH * float(self.counts.max())
        first, last = np.empty_like(lowest, dtype=np.int64), np.empty_like(lowest, dtype=np.int64)
        for axis, planes in enumerate(self.planes):
            top = len(planes) - 1
            start = np.searchsorted(planes, lowest[:, axis] - slack, side="right") - 1
            end = np.searchsorted(planes, highest[:, axis] + slack, side="left")
            first[:, axis], last[:, axis] = start.clip(0, top), end.clip(0, top)
        size = np.maximum(last - first, 0)
        starts = run_starts(size.prod(axis=1))
        out = np.zeros(len(self.low), dtype=bool)
        owner = self._owner
        done = 0
        while done < len(triangles):
            # As many triangles as fill a chunk, at least one.
            until = int(np.searchsorted(starts, starts[done] + _CHUNK, side="right")) - 1
            part = np.arange(done, max(until, done + 1))
            _, place = gather_runs(starts, part)
            triangle = np.repeat(part, np.diff(starts)[part])
            number = place - starts[triangle]
            _, nv, nw = size[triangle].T
            step = np.stack([number // (nv * nw), number // nw % nv, number % nw])
            u, v, w = first[triangle].T + step
            box = owner[u, v, w].astype(np.int64)
            pair = np.unique(triangle * len(out) + box)
            triangle, box = pair // len(out), pair % len(out)
            asked = ~out[box]
            triangle, box = triangle[asked], box[asked]
            room = TOUCH * (self.high[box] - self.low[box])
            meets = touches_boxes(
                corners[triangle],
                normals[triangle],
                edges[triangle],
                self.low[box] - room,
                self.high[box] + room,
            )
            out[box[meets]] = True
            done = int(part[-1]) + 1
        return out


def tlattice(low: Ints, high: Ints) -> TLattice:
    """The T-lattice of boxes that obey the rules of the paper.

    Rule 3: no edge is zero. Rule 2: every edge is an edge of cells, so no two boxes overlap, since
    edges of one would run through the other. Rule 1: knot intervals along parallel lines have equal
    sums, so the boxes leave no gap.

    Parameters
    ----------
    low, high : (N, 3) int64
        Corners; ``0 <= low <= high``.

    Raises
    ------
    BrokenRule
    """
    empty = np.flatnonzero((low == high).any(axis=1))
    if len(empty):
        raise BrokenRule(3, (int(empty[0]),))
    found = TLattice(low, high)
    if np.prod([float(len(planes)) for planes in found.planes]) > MAX_PLACES:
        raise BrokenRule(0)
    # A region that does not start at 0 has a gap there.
    low_end = low.min(axis=0)
    if low_end.any():
        place = np.stack([np.zeros(3, dtype=np.int64), found.counts])
        axis = int(np.argmax(low_end > 0))
        place[1, axis] = low_end[axis]
        raise BrokenRule(1, (), place)
    cover = found.cover
    for rule, bad in ((2, cover > 1), (1, cover < 1)):
        if bad.any():
            at = np.unravel_index(int(bad.argmax()), bad.shape)
            ends = [(p[i], p[i + 1]) for p, i in zip(found.planes, at, strict=True)]
            place = np.array(ends, dtype=np.int64).T
            holding = np.all((low <= place[0]) & (high >= place[1]), axis=1)
            raise BrokenRule(rule, tuple(np.flatnonzero(holding)[:2].tolist()), place)
    return found
