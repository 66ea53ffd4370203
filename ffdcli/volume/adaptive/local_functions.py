"""Products of B-splines, each with its own knots, listed by the polynomial cells they reach.

A function is ``N(u) N(v) N(w)``; each factor is the B-spline on its own ``degree + 2`` rising
knots. Knots are integers, in units of the finest cell of an octree, whose leaves are so small that
no function has a knot inside one: all functions are polynomials there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows, gather_runs, pad_rows
from ffdcli.splines.knots import blossom_weights
from ffdcli.volume.adaptive.extraction import Extraction
from ffdcli.volume.adaptive.octree import Octree
from ffdcli.volume.adaptive.reach import Listed, Reach

# Leaves treated together: bounds the memory.
_LEAVES = 20_000
# (knots (q, k + 2), low (q,), high (q,)) -> coefficients (q, k + 1) of each B-spline on [low, high]
Form = Callable[[Ints, Ints, Ints], Floats]


@dataclass(frozen=True)
class LocalFunctions:
    """Functions, and the octree of the cells on which they are polynomials.

    Parameters
    ----------
    degrees : (int, int, int)
    knots : three (n, k_a + 2) int64
        Rising, in finest units of the octree.
    tree : Octree
        See :func:`~ffdcli.volume.adaptive.polynomial_cells.polynomial_cells`.
    """

    degrees: tuple[int, int, int]
    knots: tuple[Ints, Ints, Ints]
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
        """Functions whose supports meet the leaves (m,).

        A model touches few of the leaves; lists are made on demand, and cached.
        """
        listed = self._listed[0] if self._listed else self._nothing()
        asked = np.unique(leaves)
        new = asked[listed.row[asked] < 0]
        if len(new):
            listed = listed.extended(new, self._list(new))
            self._listed[:] = [listed]
        return listed.reach.take(listed.row[leaves])

    def reached(self, chosen: Bools, leaves: Ints) -> Ints:
        """Those of the leaves (m,), each once, that the supports of chosen functions (n,) meet."""
        low, high, asked = self.low[chosen], self.high[chosen], np.unique(leaves)
        parts = np.array_split(asked, 1 + len(asked) // _LEAVES)
        return np.concatenate([np.unique(self.tree.meeting(low, high, part)[1]) for part in parts])

    def _nothing(self) -> Listed:
        none = np.zeros(0, dtype=np.int64)
        row = np.full(len(self.tree.size), -1, dtype=np.int64)
        return Listed(row, self._list(none))

    def _list(self, leaves: Ints) -> Reach:
        """Lists of leaves (m,), which increase."""
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
        planes are knots; others bound cells that a knot along another axis divides.

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
        """Values of all factors at points, by the recursion of Cox and de Boor.

        Parameters
        ----------
        reach : Reach
            Lists of the points' leaves, one entry per leaf.
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
            values.append(bspline_values(knots.astype(np.float64), at[:, None])[:, 0])
        return starts, values

    def bezier_forms(self, leaves: Ints) -> Extraction:
        """Bézier points of the functions on leaves (m,)."""
        return self._forms(leaves, bezier_forms)

    def chebyshev_forms(self, leaves: Ints) -> Extraction:
        """Chebyshev coefficients of the functions on leaves (m,).

        They come from values at the Chebyshev points of each leaf, by Cox and de Boor's recursion:
        no Bézier points, which surfaces are made of, enter.
        """
        return self._forms(leaves, chebyshev_forms)

    def _forms(self, leaves: Ints, form: Form) -> Extraction:
        reach = self.reaching(leaves)
        u, v, w = (self._on_leaves(reach, leaves, axis, form) for axis in range(3))
        return Extraction(reach, (u, v, w))

    def _on_leaves(self, reach: Reach, leaves: Ints, axis: int, form: Form) -> Floats:
        """(q, k + 1) form of each factor on its leaf, computed once for equal ones."""
        tables, _ = self._factors
        row = np.repeat(leaves, np.diff(reach.factor_starts[axis]))
        low = self.tree.low[row, axis]
        keys = np.stack([reach.factors[axis], low, low + self.tree.size[row]], axis=-1)
        distinct, which = distinct_rows(keys)
        found = form(tables[axis][distinct[:, 0]], distinct[:, 1], distinct[:, 2])
        return found[which]


def bspline_values(knots: Floats, at: Floats) -> Floats:
    """B-splines on knots (q, k + 2) at places (q, p)."""
    degree = knots.shape[1] - 2
    x, t = at[:, :, None], knots[:, None, :]
    # Half-open pieces: from degree 1 on, the side that a knot belongs to makes no difference.
    parts = ((x >= t[..., :-1]) & (x < t[..., 1:])).astype(np.float64)
    for k in range(1, degree + 1):
        left, right = t[..., : -k - 1], t[..., k + 1 :]
        rise = (x - left) / (t[..., k:-1] - left)
        fall = (right - x) / (right - t[..., 1:-k])
        parts = rise * parts[..., :-1] + fall * parts[..., 1:]
    return np.asarray(parts[..., 0])


def chebyshev_forms(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Chebyshev coefficients (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each.
    """
    degree = knots.shape[1] - 2
    nodes = np.polynomial.chebyshev.chebpts1(degree + 1)
    at = low[:, None] + (high - low)[:, None] * (1 + nodes) / 2
    values = bspline_values(knots.astype(np.float64), at)
    # At these points the polynomials are orthogonal.
    transform = np.polynomial.chebyshev.chebvander(nodes, degree) * 2 / (degree + 1)
    transform[:, 0] /= 2
    return values @ transform


def bezier_forms(knots: Ints, low: Ints, high: Ints) -> Floats:
    """Bézier points (q, k + 1) of B-splines on knots (q, k + 2), over [low, high] (q,).

    The interval lies in one span of each. Each function belongs to a B-spline basis whose other
    knots do not matter; its Bézier points are blossoms.
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
