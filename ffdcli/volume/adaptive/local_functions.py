"""Products of B-splines with knots of their own, listed by the polynomial cells they reach.

A function is ``N(u) N(v) N(w)``, each factor the B-spline on ``degree + 2`` rising knots of its
own. Knots are integers, in units of the finest cell of an octree, whose leaves are so small that
no function has a knot inside one: all functions are polynomials there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ffdcli.arrays import Floats, Ints, gather_runs, places_in_runs
from ffdcli.splines.knots import blossom_weights
from ffdcli.volume.adaptive.octree import Octree, interleave
from ffdcli.volume.adaptive.octree_growth import tree_of

Knots = tuple[Ints, Ints, Ints]


@dataclass(frozen=True)
class Reach:
    """Functions that reach each of some leaves.

    Along an axis the functions of a leaf have few different factors; each is listed once.

    Parameters
    ----------
    starts : (m + 1,) int64
        Leaf ``i`` is reached by ``functions[starts[i]:starts[i + 1]]``.
    functions : (p,) int64
    factor_starts : three (m + 1,) int64
    factors : three (q,) int64
        Rows of the table of distinct factors, leaf by leaf.
    places : (p, 3) int64
        For each function of a leaf the places of its factors among the leaf's factors.
    """

    starts: Ints
    functions: Ints
    factor_starts: tuple[Ints, Ints, Ints]
    factors: tuple[Ints, Ints, Ints]
    places: Ints

    def take(self, rows: Ints) -> Reach:
        """The lists of the chosen leaves, in that order."""
        starts, index = gather_runs(self.starts, rows)
        pairs = [gather_runs(self.factor_starts[axis], rows) for axis in range(3)]
        u, v, w = (self.factors[axis][pairs[axis][1]] for axis in range(3))
        return Reach(
            starts,
            self.functions[index],
            (pairs[0][0], pairs[1][0], pairs[2][0]),
            (u, v, w),
            self.places[index],
        )


@dataclass(frozen=True)
class Listed:
    """The lists made so far.

    Parameters
    ----------
    row : (N,) int64
        Entry of each leaf of the octree in ``reach``, -1 where it has none yet.
    reach : Reach
    """

    row: Ints
    reach: Reach

    def extended(self, leaves: Ints, more: Reach) -> Listed:
        """The same with the lists of further leaves (m,) behind them."""
        row = self.row.copy()
        row[leaves] = len(self.reach.starts) - 1 + np.arange(len(leaves))
        old = self.reach
        first = [_joined(a, b) for a, b in zip(old.factor_starts, more.factor_starts, strict=True)]
        u, v, w = (np.concatenate([a, b]) for a, b in zip(old.factors, more.factors, strict=True))
        reach = Reach(
            _joined(old.starts, more.starts),
            np.concatenate([old.functions, more.functions]),
            (first[0], first[1], first[2]),
            (u, v, w),
            np.concatenate([old.places, more.places]),
        )
        return Listed(row, reach)


@dataclass(frozen=True)
class LocalFunctions:
    """The functions and the octree of cells in which they are polynomials.

    Parameters
    ----------
    degrees : (int, int, int)
    knots : three (n, k_a + 2) int64
        Rising, in finest units of the octree.
    tree : Octree
        See :func:`polynomial_cells`.
    """

    degrees: tuple[int, int, int]
    knots: Knots
    tree: Octree
    _listed: list[Listed] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def count(self) -> int:
        """Number of functions."""
        return len(self.knots[0])

    @cached_property
    def low(self) -> Ints:
        """(n, 3) low corners of the supports."""
        return np.stack([t[:, 0] for t in self.knots], axis=-1)

    @cached_property
    def high(self) -> Ints:
        """(n, 3) high corners of the supports."""
        return np.stack([t[:, -1] for t in self.knots], axis=-1)

    @cached_property
    def _factors(self) -> tuple[tuple[Ints, Ints, Ints], Ints]:
        """Distinct knot vectors along each axis, and which of them each function (n, 3) has."""
        found = [distinct_rows(t) for t in self.knots]
        index = np.stack([which for _, which in found], axis=-1)
        return (found[0][0], found[1][0], found[2][0]), index

    def reaching(self, leaves: Ints) -> Reach:
        """Functions whose support meets the leaves (m,).

        A model touches few of the leaves; lists are made when they are asked for, and kept.
        """
        listed = self._listed[0] if self._listed else self._nothing()
        asked = np.unique(leaves)
        new = asked[listed.row[asked] < 0]
        if len(new):
            listed = listed.extended(new, self._list(new))
            self._listed[:] = [listed]
        return listed.reach.take(listed.row[leaves])

    def _nothing(self) -> Listed:
        none = np.zeros(0, dtype=np.int64)
        row = np.full(len(self.tree.size), -1, dtype=np.int64)
        return Listed(row, self._list(none))

    def _list(self, leaves: Ints) -> Reach:
        """Lists of some leaves (m,), rising."""
        function, leaf = self.tree.meeting(self.low, self.high, leaves)
        entry = np.searchsorted(leaves, leaf)
        ends = np.arange(len(leaves) + 1)
        tables, which = self._factors
        firsts, lists, places = [], [], []
        for axis in range(3):
            width = len(tables[axis])
            keys = entry * width + which[function, axis]
            present = np.zeros(len(leaves) * width, dtype=bool)
            present[keys] = True
            factors = np.flatnonzero(present)
            first = np.searchsorted(factors, ends * width)
            number = np.cumsum(present) - 1
            firsts.append(first)
            lists.append(factors % width)
            places.append(number[keys] - first[entry])
        return Reach(
            np.searchsorted(entry, ends),
            function,
            (firsts[0], firsts[1], firsts[2]),
            (lists[0], lists[1], lists[2]),
            np.stack(places, axis=-1),
        )

    def planes(self, axis: int, low: Floats, high: Floats) -> Floats:
        """Sides of the octree's cells strictly within boxes (m, 3); NaN where a box has fewer.

        Between these planes a box lies in one cell, so the functions are polynomials there. Most
        of them are knots; some only end a cell that a knot along another axis divides.

        Returns
        -------
        (m, n) float64, finest units, rising
        """
        box, leaf = self.tree.meeting(low, high)
        first = self.tree.low[leaf, axis]
        values = np.concatenate([first, first + self.tree.size[leaf]])
        owner = np.concatenate([box, box])
        within = (values > low[owner, axis]) & (values < high[owner, axis])
        top = (1 << self.tree.depth) + 1
        keys = np.unique(owner[within] * top + values[within])
        return pad_rows(keys % top, keys // top, len(low))

    def factor_values(
        self, reach: Reach, owner: Ints, places: Floats
    ) -> tuple[list[Ints], list[Floats]]:
        """All factors at points, by Cox and de Boor's recursion.

        Parameters
        ----------
        reach : Reach
            Of the points' leaves, one entry a leaf.
        owner : (m,) int64
            Entry of ``reach`` that holds each point.
        places : (m, 3) float64, finest units

        Returns
        -------
        per axis (m + 1,) starts and (q,) values
        """
        tables, _ = self._factors
        starts, values = [], []
        for axis in range(3):
            start, index = gather_runs(reach.factor_starts[axis], owner)
            knots = tables[axis][reach.factors[axis][index]]
            at = np.repeat(places[:, axis], np.diff(start))
            starts.append(start)
            values.append(_bspline(knots.astype(np.float64), at[:, None])[:, 0])
        return starts, values

    def bezier_factors(self, reach: Reach, leaves: Ints, axis: int) -> Floats:
        """Bézier points (q, k + 1) of the factors of ``reach`` on their own leaves (m,)."""
        return self._on_leaves(reach, leaves, axis, _bezier)

    def chebyshev_factors(self, reach: Reach, leaves: Ints, axis: int) -> Floats:
        """Chebyshev coefficients (q, k + 1) of the factors on their own leaves (m,).

        From values at the Chebyshev points of each leaf, by Cox and de Boor's recursion: nothing
        here comes from the Bézier points that surfaces are made of.
        """
        return self._on_leaves(reach, leaves, axis, _chebyshev)

    def _on_leaves(
        self, reach: Reach, leaves: Ints, axis: int, form: Callable[[Ints, Ints, Ints], Floats]
    ) -> Floats:
        """A form of each factor on its leaf, worked out once for equal factors and intervals."""
        tables, _ = self._factors
        row = np.repeat(leaves, np.diff(reach.factor_starts[axis]))
        low = self.tree.low[row, axis]
        keys = np.stack([reach.factors[axis], low, low + self.tree.size[row]], axis=-1)
        distinct, which = distinct_rows(keys)
        found = form(tables[axis][distinct[:, 0]], distinct[:, 1], distinct[:, 2])
        return found[which]


def polynomial_cells(knots: Knots, depth: int) -> Octree:
    """The coarsest octree in whose leaves no function has a knot.

    Parameters
    ----------
    knots : three (n, k_a + 2) int64
        In finest units. What lies beyond ``0 .. 2**depth`` does not count.
    depth : int
    """
    top = 1 << depth
    low = np.stack([t[:, 0] for t in knots], axis=-1).clip(0, top)
    high = np.stack([t[:, -1] for t in knots], axis=-1).clip(0, top)
    codes: list[list[Ints]] = [[] for _ in range(depth)]
    for axis in range(3):
        others = [(axis + 1) % 3, (axis + 2) % 3]
        # A knot plane ends, beside itself, cells no larger than its largest power of two.
        count = knots[axis].shape[1]
        sheet = np.column_stack(
            [
                knots[axis].reshape(-1),
                np.repeat(low[:, others], count, axis=0),
                np.repeat(high[:, others], count, axis=0),
            ]
        )
        sheet, _ = distinct_rows(sheet[(sheet[:, 0] > 0) & (sheet[:, 0] < top)])
        power = sheet[:, 0] & -sheet[:, 0]
        for level in range(depth):
            side = 1 << (depth - level)
            # Cells of this side have the plane in their middle: they are divided.
            rows = sheet[power == side >> 1]
            first = rows[:, 1:3] // side
            last = -(-rows[:, 3:5] // side)
            owner, place = _rectangles(first, last)
            cells = np.empty((len(owner), 3), dtype=np.int64)
            cells[:, axis] = rows[owner, 0] // side
            cells[:, others] = place
            codes[level].append(np.unique(interleave(cells)))
    return tree_of([np.unique(np.concatenate(each)) for each in codes])


def distinct_rows(rows: Ints) -> tuple[Ints, Ints]:
    """The distinct rows of integers (m, c), and which of them each row is (m,).

    Column by column, which sorts numbers where ``np.unique`` with an axis sorts records.
    """
    which = np.zeros(len(rows), dtype=np.int64)
    sample = np.zeros(0, dtype=np.int64)
    for column in rows.T:
        low = int(column.min(initial=0))
        width = int(column.max(initial=0)) - low + 1
        _, sample, which = np.unique(
            which * width + column - low, return_index=True, return_inverse=True
        )
    return rows[sample], which.reshape(-1)


def _joined(first: Ints, second: Ints) -> Ints:
    return np.concatenate([first, second[1:] + first[-1]])


def pad_rows(values: Ints, owner: Ints, count: int) -> Floats:
    """Values (p,) of rising owners (p,) as rows (count, n), NaN behind the last of each."""
    lengths = np.bincount(owner, minlength=count)
    out = np.full((count, int(lengths.max(initial=0))), np.nan)
    out[owner, places_in_runs(lengths)] = values
    return out


def _rectangles(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """All integer places (p, 2) of rectangles [first, last) (m, 2), with their owners (p,)."""
    size = last - first
    count = size[:, 0] * size[:, 1]
    owner = np.repeat(np.arange(len(first)), count)
    number = places_in_runs(count)
    place = np.stack([number // size[owner, 1], number % size[owner, 1]], axis=-1)
    return owner, first[owner] + place


def _bspline(knots: Floats, at: Floats) -> Floats:
    """B-splines on knots (q, k + 2) at places (q, p)."""
    degree = knots.shape[1] - 2
    x, t = at[:, :, None], knots[:, None, :]
    # Half-open pieces; which side a knot itself counts to makes no difference from degree 1 on.
    parts = ((x >= t[..., :-1]) & (x < t[..., 1:])).astype(np.float64)
    for k in range(1, degree + 1):
        left, right = t[..., : -k - 1], t[..., k + 1 :]
        rise = (x - left) / (t[..., k:-1] - left)
        fall = (right - x) / (right - t[..., 1:-k])
        parts = rise * parts[..., :-1] + fall * parts[..., 1:]
    return np.asarray(parts[..., 0])


def _chebyshev(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Chebyshev coefficients (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each.
    """
    degree = knots.shape[1] - 2
    nodes = np.polynomial.chebyshev.chebpts1(degree + 1)
    at = low[:, None] + (high - low)[:, None] * (1 + nodes) / 2
    values = _bspline(knots.astype(np.float64), at)
    # At these points the polynomials are orthogonal.
    transform = np.polynomial.chebyshev.chebvander(nodes, degree) * 2 / (degree + 1)
    transform[:, 0] /= 2
    return values @ transform


def _bezier(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Bézier points (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each. The function is one of a B-spline basis whose further
    knots make no difference, and its Bézier points are blossoms.
    """
    rows, degree = len(knots), knots.shape[1] - 2
    steps = np.arange(1, degree + 1)
    padded = np.column_stack([knots[:, :1] - steps[::-1], knots, knots[:, -1:] + steps]).astype(
        np.float64
    )
    span = (knots <= low[:, None]).sum(axis=1) - 1
    spans = np.arange(rows) * padded.shape[1] + degree + span
    take_high = np.arange(degree)[None, :] >= degree - np.arange(degree + 1)[:, None]
    arguments = np.where(take_high, high[:, None, None], low[:, None, None]).astype(np.float64)
    weights = blossom_weights(padded.ravel(), degree, spans[:, None], arguments)
    out: Floats = np.take_along_axis(weights, (degree - span)[:, None, None], axis=2)[:, :, 0]
    return out
