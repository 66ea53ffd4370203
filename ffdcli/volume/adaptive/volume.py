"""Volumes of local functions on an octree: Bézier form, evaluation and bounds of each cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.splines.knots import restriction_weights, value_weights
from ffdcli.volume.adaptive.adaptive_map import CHUNK_POINTS, AdaptiveMap
from ffdcli.volume.adaptive.extraction import CellRestriction
from ffdcli.volume.boxes import parts_in_box
from ffdcli.volume.net_kind import NetKind
from ffdcli.volume.slope_hulls import slope_hulls


@dataclass(frozen=True)
class AdaptiveVolume(AdaptiveMap):
    """``D(x) = x + N(x) / W(x)``, or another :class:`NetKind`, with local functions.

    Parameters
    ----------
    displaces : bool
        False for :meth:`plain_map`.
    """

    displaces: bool = True
    _known: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def needs_fit(self) -> Literal[False]:
        """False."""
        return False

    @property
    def net_kind(self) -> NetKind:
        """How the net's polynomials become the deformation."""
        return NetKind(displaces=self.displaces, components=self.net.shape[1])

    def plain_map(self, points: Floats, weights: Floats) -> AdaptiveVolume:
        """The map ``P(u) = sum w P_i B_i / sum w B_i`` itself (Song & Yang 2005, Eq. 5).

        At rest it is the identity only where cells have one size and weights are equal.
        """
        net = np.column_stack([weights[:, None] * points, weights])
        return replace(self, net=net, displaces=False)

    @cached_property
    def rest_map(self) -> AdaptiveVolume:
        """The plain map at rest; kept, since its forms on cells are cached."""
        return self.plain_map(self.rest_points, self.rest_weights)

    @property
    def largest(self) -> float:
        """Sum of the largest coordinate of the box and the largest displacement."""
        moved = np.abs(self._moves).max(initial=0.0)
        reach = np.abs(self.box[np.isfinite(self.box)]).max(initial=0.0)
        return float(reach + moved)

    @property
    def _moves(self) -> Floats:
        """(n, 3) displacements of the control points."""
        if self.net.shape[1] == 3:
            return self.net
        moved = self.net[:, :3] / self.net[:, 3:4]
        return moved if self.net.shape[1] == 4 else moved - self.net[:, 4:7] / self.net[:, 7:]

    def cells(self, points: Floats) -> Ints:
        """(m, 3) low corners, in finest units, of the polynomial cells that hold points (m, 3)."""
        return self.functions.tree.low[self._leaves(points)]

    def cell_bounds(self, cells: Ints) -> Floats:
        """(m, 2, 3) corners of polynomial cells."""
        size = self.functions.tree.size[self.functions.tree.locate(cells)]
        ends = np.stack([cells, cells + size[:, None]], axis=1)
        return np.asarray(self.origin + ends * self.unit)

    def restrict(self, cells: Ints, low: Floats, high: Floats) -> CellRestriction:
        """Bézier form of each cell's polynomial, continued if need be, on boxes (m, 3), (m, 3)."""
        return self._restricted(cells, (low, high), restriction_weights)

    def at_points(self, cells: Ints, points: Floats) -> CellRestriction:
        """Value of each cell's polynomial, continued if need be, at a point (m, 3)."""
        return self._restricted(cells, (points,), value_weights)

    def _restricted(
        self, cells: Ints, ends: tuple[Floats, ...], matrices: Callable[..., Floats]
    ) -> CellRestriction:
        """The map to the forms that ``matrices`` makes between ``ends``, axis by axis."""
        leaves = self.functions.tree.locate(cells)
        used, which = np.unique(leaves, return_inverse=True)
        bounds = self.cell_bounds(cells)
        weights = []
        for axis, degree in enumerate(self.degrees):
            # In shares of the cell, so that the knots 0 and 1 of a Bézier form serve all cells.
            extent = bounds[:, 1, axis] - bounds[:, 0, axis]
            share = [(end[:, axis] - bounds[:, 0, axis]) / extent for end in ends]
            knots = np.repeat([0.0, 1.0], degree + 1)
            spans = np.full(len(cells), degree)
            weights.append(matrices(knots, degree, spans, *share))
        forms = self.functions.bezier_forms(used)
        return CellRestriction(forms, which.reshape(-1), (weights[0], weights[1], weights[2]))

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3): direct evaluation, the identity outside the box.

        From the Chebyshev form of each cell's polynomial, independent of the Bézier points that
        surfaces are made of.
        """
        out = np.array(points, dtype=np.float64)
        for part in parts_in_box(points, self.box, CHUNK_POINTS):
            values = self._forms_at(points[part], slopes=False)[:, 0]
            out[part] = self.net_kind.images(values, points[part])
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): [i, j] is d D_i / d u_j; identity outside."""
        return self.linearise(points)[1]

    def has_parameters(self, points: Floats) -> Bools:
        """(m,) True: points are their own parameters."""
        return np.ones(len(points), dtype=bool)

    def slope_sums(self, points: Floats) -> None:
        """None: the volume is no tensor product."""
        return None

    def linearise(self, points: Floats) -> tuple[Floats, Floats]:
        """Images (m, 3) and derivatives (m, 3, 3) at once."""
        images = np.array(points, dtype=np.float64)
        slopes = np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        for part in parts_in_box(points, self.box, CHUNK_POINTS):
            found = self._forms_at(points[part], slopes=True)
            images[part] = self.net_kind.images(found[:, 0], points[part])
            slopes[part] = self.net_kind.slopes(found[:, 0], np.swapaxes(found[:, 1:], 1, 2))
        return images, slopes

    def _forms_at(self, points: Floats, *, slopes: bool) -> Floats:
        """Values of the net (m, 1, c); with slopes also derivatives along u, v, w (m, 4, c)."""
        leaves = self._leaves(points)
        tree = self.functions.tree
        middle = tree.low[leaves] + tree.size[leaves, None] / 2
        share = ((points - self.origin) / self.unit - middle) * 2 / tree.size[leaves, None]
        scale = 2 / (tree.size[leaves, None] * self.unit)
        u, v, w = (
            _chebyshev_rows(share[:, axis], degree, scale[:, axis], slopes=slopes)
            for axis, degree in enumerate(self.degrees)
        )
        forms = self._forms(leaves)
        m, nu, nv, nw, c = forms.shape
        along_u = (u @ forms.reshape(m, nu, nv * nw * c)).reshape(m, -1, nv, nw * c)
        along_v = (v[:, None] @ along_u).reshape(m, u.shape[1], v.shape[1], nw, c)
        grid = w[:, None, None] @ along_v
        if not slopes:
            return grid[:, 0, 0]
        return np.stack([grid[:, 0, 0, 0], grid[:, 1, 0, 0], grid[:, 0, 1, 0], grid[:, 0, 0, 1]], 1)

    def _forms(self, leaves: Ints) -> Floats:
        """Chebyshev coefficients (m, ku + 1, kv + 1, kw + 1, c) of the net on leaves (m,).

        Computed once for each leaf, and cached.
        """
        if not self._known:
            nothing = np.zeros((0, *(k + 1 for k in self.degrees), self.net.shape[1]))
            self._known[:] = [np.full(len(self.functions.tree.size), -1), nothing]
        row, forms = self._known
        asked = np.unique(leaves)
        new = asked[row[asked] < 0]
        if len(new):
            made = self.functions.chebyshev_forms(new).apply(self.net, np.arange(len(new)))
            row[new] = len(forms) + np.arange(len(new))
            forms = np.concatenate([forms, made])
            self._known[1] = forms
        return forms[row[leaves]]

    def is_identity(self, cells: Ints) -> Bools:
        """(m,) True for polynomial cells (m, 3) that no moved control point reaches."""
        if not self.displaces:
            return np.zeros(len(cells), dtype=bool)
        net = self.net
        changed = net[:, :4] != net[:, 4:] if net.shape[1] == 8 else net[:, :3] != 0
        leaves = self.functions.tree.locate(cells)
        return ~np.isin(leaves, self.functions.reached(changed.any(axis=1), leaves))

    def slope_bounds(self, cells: Ints) -> Floats:
        """(3,) upper bounds, over cells (m, 3), of |dD/du|, |dD/dv| and |dD/dw|, at least 1.

        From the Bézier points of the cells.
        """
        part = np.unique(cells, axis=0)
        part = part[~self.is_identity(part)]
        found = [hulls.longest() for hulls in slope_hulls(self, part, self.cell_bounds(part))]
        return np.concatenate([np.ones((1, 3)), *found]).max(axis=0)

    def least_weight(self, cells: Ints) -> float:
        """A lower bound of the weights of completed forms in cells (m, 3)."""
        part = np.unique(cells, axis=0)
        ends = self.cell_bounds(part)
        weights = self.restrict(part, ends[:, 0], ends[:, 1])
        found = weights.apply(self.net_kind.weight_part(self.net))
        return float(np.prod(found.min(axis=(0, 1, 2, 3))))


def _chebyshev_rows(at: Floats, degree: int, scale: Floats, *, slopes: bool) -> Floats:
    """Chebyshev polynomials (m, 1, k + 1) at points of [-1, 1]; with slopes (m, 2, k + 1)."""
    values = np.ones((len(at), degree + 1))
    if degree:
        values[:, 1] = at
    for k in range(2, degree + 1):
        values[:, k] = 2 * at * values[:, k - 1] - values[:, k - 2]
    if not slopes:
        return values[:, None, :]
    # T_k' = k U_{k - 1}, with U_k = x U_{k - 1} + T_k.
    rows = np.zeros((len(at), 2, degree + 1))
    rows[:, 0] = values
    second = np.ones(len(at))
    for k in range(1, degree + 1):
        rows[:, 1, k] = k * second * scale
        second = at * second + values[:, k]
    return rows
