"""Volumes of local functions on an octree: finer where the model is.

T-spline and hierarchical volumes differ in their functions and in what the net stands for; all the
rest is here. The deformation displaces places, so it is the identity, to the last bit, wherever no
function that reaches the place is edited.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints, gather_runs
from ffdcli.splines.knots import KnotPlanes, restriction_weights
from ffdcli.volume.adaptive.extraction import CellRestriction, Extraction
from ffdcli.volume.adaptive.local_functions import LocalFunctions
from ffdcli.volume.frame import Frame
from ffdcli.volume.net_kind import NetKind
from ffdcli.volume.slope_hulls import slope_hulls

# Points looked at together: bounds the memory.
_CHUNK_POINTS = 20_000


@dataclass(frozen=True)
class AdaptiveVolume:
    """``D(x) = x + N(x) / W(x)``, or of another :class:`NetKind`, with functions of their own.

    Parameters
    ----------
    functions : LocalFunctions
    rest_points : (n, 3) float64, lattice frame
        Where the control points are before any edit.
    rest_weights : (n,) float64
        Their weights then.
    level : (n,) int64
        Level of the octree that each function belongs to; 0 is the coarsest.
    hidden : (n,) bool
        Control points that are not to be edited unless asked for.
    net : (n, 3, 4 or 8) float64
        What the functions are multiplied by; see :meth:`with_control`.
    origin, unit : (3,) float64, lattice frame
        Low corner of the octree that the functions' knots count from, and the finest unit.
    box : (2, 3) float64, lattice frame
        Outside it the deformation is the identity.
    frame : Frame
    weighted : bool
        Whether the functions are weighted and add up to 1 only as quotients.
    displaces : bool
        False for :meth:`plain_map`.
    """

    functions: LocalFunctions
    rest_points: Floats
    rest_weights: Floats
    level: Ints
    hidden: Bools
    net: Floats
    origin: Floats
    unit: Floats
    box: Floats
    frame: Frame
    weighted: bool
    displaces: bool = True
    _known: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Degree along u, v and w."""
        return self.functions.degrees

    @property
    def shape(self) -> tuple[int]:
        """Number of control points."""
        return (self.functions.count,)

    @property
    def net_kind(self) -> NetKind:
        """What the net stands for."""
        return NetKind(displaces=self.displaces, components=self.net.shape[1])

    def with_net(self, net: Floats) -> AdaptiveVolume:
        """The same volume with another net."""
        return replace(self, net=net)

    def with_control(self, points: Floats, weights: Floats) -> AdaptiveVolume:
        """The volume with control points (n, 3) and weights (n,).

        Without weights the net is what control points have moved by. With weights as at rest it
        is ``(w (P - P0), w)``: both quotients have one denominator. With others it holds both
        quotients, ``(w P, w, w0 P0, w0)``, their points counted from the middle of the box.
        """
        moved = points - self.rest_points
        if not self.weighted:
            return self.with_net(moved)
        rest = self.rest_weights
        if np.array_equal(weights, rest):
            return self.with_net(np.column_stack([rest[:, None] * moved, rest]))
        arm = self.rest_points - self.box.mean(axis=0)
        new = np.column_stack([weights[:, None] * (arm + moved), weights])
        return self.with_net(np.column_stack([new, rest[:, None] * arm, rest]))

    def plain_map(self, points: Floats, weights: Floats) -> AdaptiveVolume:
        """The map ``P(u) = sum w P_i B_i / sum w B_i`` itself (Song & Yang 2005, Eq. 5).

        At rest it is the identity only where the cells are alike and weights equal.
        """
        net = np.column_stack([weights[:, None] * points, weights])
        return replace(self, net=net, displaces=False)

    @cached_property
    def rest_map(self) -> AdaptiveVolume:
        """The plain map at rest; kept, since its forms on cells are worked out once."""
        return self.plain_map(self.rest_points, self.rest_weights)

    def same_basis(self, other: object) -> bool:
        """True where functions and frame agree, so that a plan serves both."""
        return (
            isinstance(other, AdaptiveVolume)
            and type(other) is type(self)
            and self.degrees == other.degrees
            and self.net.shape == other.net.shape
            and all(
                np.array_equal(a, b)
                for a, b in zip(self.functions.knots, other.functions.knots, strict=True)
            )
            and np.array_equal(self.origin, other.origin)
            and np.array_equal(self.unit, other.unit)
            and np.array_equal(self.frame.origin, other.frame.origin)
            and np.array_equal(self.frame.axes, other.frame.axes)
        )

    @property
    def largest(self) -> float:
        """Largest coordinate of the box and of what control points move by."""
        moved = np.abs(self._moves).max(initial=0.0)
        reach = np.abs(self.box[np.isfinite(self.box)]).max(initial=0.0)
        return float(reach + moved)

    @property
    def _moves(self) -> Floats:
        """(n, 3) what control points have moved by."""
        if self.net.shape[1] == 3:
            return self.net
        moved = self.net[:, :3] / self.net[:, 3:4]
        return moved if self.net.shape[1] == 4 else moved - self.net[:, 4:7] / self.net[:, 7:]

    def knot_planes(self, axis: int, boxes: Floats) -> KnotPlanes:
        """Breaks (m, n) along ``axis`` within each of the boxes (m, 2, 3), NaN where fewer.

        Those are the sides of the polynomial cells in the box.
        """
        low = (boxes[:, 0] - self.origin) / self.unit
        high = (boxes[:, 1] - self.origin) / self.unit
        values = self.origin[axis] + self.functions.planes(axis, low, high) * self.unit[axis]
        smooth = np.full(values.shape, self.degrees[axis] - 1)
        return KnotPlanes(values, smooth)

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
        leaves = self.functions.tree.locate(cells)
        used, which = np.unique(leaves, return_inverse=True)
        bounds = self.cell_bounds(cells)
        weights = []
        for axis, degree in enumerate(self.degrees):
            # Shares of the cell, so that a Bézier form's own knots 0 and 1 serve all.
            extent = bounds[:, 1, axis] - bounds[:, 0, axis]
            share = [(end[:, axis] - bounds[:, 0, axis]) / extent for end in (low, high)]
            knots = np.repeat([0.0, 1.0], degree + 1)
            spans = np.full(len(cells), degree)
            weights.append(restriction_weights(knots, degree, spans, share[0], share[1]))
        reach = self.functions.reaching(used)
        factors = tuple(self.functions.bezier_factors(reach, used, axis) for axis in range(3))
        extraction = Extraction(reach, (factors[0], factors[1], factors[2]))
        return CellRestriction(extraction, which.reshape(-1), (weights[0], weights[1], weights[2]))

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3): direct evaluation, the identity outside the box.

        From the Chebyshev form of each cell's polynomial, which shares no arithmetic with the
        Bézier points of the surfaces it judges.
        """
        out = np.array(points, dtype=np.float64)
        for part in self._inside_chunks(points):
            values = self._forms_at(points[part], slopes=False)[:, 0]
            out[part] = self.net_kind.images(values, points[part])
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): [i, j] is d D_i / d u_j; identity outside."""
        return self.linearise(points)[1]

    def linearise(self, points: Floats) -> tuple[Floats, Floats]:
        """Images (m, 3) and derivatives (m, 3, 3) at once."""
        images = np.array(points, dtype=np.float64)
        slopes = np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        for part in self._inside_chunks(points):
            found = self._forms_at(points[part], slopes=True)
            images[part] = self.net_kind.images(found[:, 0], points[part])
            slopes[part] = self.net_kind.slopes(found[:, 0], np.swapaxes(found[:, 1:], 1, 2))
        return images, slopes

    def _inside_chunks(self, points: Floats) -> list[Ints]:
        """Points in the box, in parts that bound the memory of the gathered forms."""
        inside = np.flatnonzero(self.contains(points))
        return np.array_split(inside, -(-len(inside) // _CHUNK_POINTS)) if len(inside) else []

    def _forms_at(self, points: Floats, *, slopes: bool) -> Floats:
        """Values of the net (m, 1, c), and derivatives along u, v, w behind them (m, 4, c)."""
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

        Worked out once for each leaf, and kept.
        """
        if not self._known:
            nothing = np.zeros((0, *(k + 1 for k in self.degrees), self.net.shape[1]))
            self._known[:] = [np.full(len(self.functions.tree.size), -1), nothing]
        row, forms = self._known
        asked = np.unique(leaves)
        new = asked[row[asked] < 0]
        if len(new):
            reach = self.functions.reaching(new)
            u, v, w = (self.functions.chebyshev_factors(reach, new, axis) for axis in range(3))
            made = Extraction(reach, (u, v, w)).apply(self.net, np.arange(len(new)))
            row[new] = len(forms) + np.arange(len(new))
            forms = np.concatenate([forms, made])
            self._known[1] = forms
        return forms[row[leaves]]

    def contains(self, points: Floats) -> Bools:
        """(m,) True for points in the closed box."""
        return np.all((points >= self.box[0]) & (points <= self.box[1]), axis=1)

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse values of the functions at points (m, 3) of the box."""
        leaves, owner = np.unique(self._leaves(points), return_inverse=True)
        reach = self.functions.reaching(leaves)
        places = (points - self.origin) / self.unit
        firsts, factors = self.functions.factor_values(reach, owner.reshape(-1), places)
        starts, index = gather_runs(reach.starts, owner.reshape(-1))
        values = np.ones(len(index))
        for axis in range(3):
            row = np.repeat(firsts[axis][:-1], np.diff(starts)) + reach.places[index, axis]
            values *= factors[axis][row]
        shape = (len(points), self.functions.count)
        return csr_array((values, reach.functions[index], starts), shape=shape)

    def supports(self) -> tuple[Floats, Floats]:
        """Where each function is positive: corners (n, 3), (n, 3)."""
        low = self.origin + self.functions.low * self.unit
        high = self.origin + self.functions.high * self.unit
        return low, high

    def still(self, cells: Ints) -> Bools:
        """(m,) True for polynomial cells (m, 3) that no moved control point reaches."""
        if not self.displaces:
            return np.zeros(len(cells), dtype=bool)
        net = self.net
        changed = net[:, :4] != net[:, 4:] if net.shape[1] == 8 else net[:, :3] != 0
        reach = self.functions.reaching(self.functions.tree.locate(cells))
        moved = np.concatenate([[0], np.cumsum(changed.any(axis=1)[reach.functions])])
        return np.asarray(moved[reach.starts[1:]] == moved[reach.starts[:-1]])

    def slope_bounds(self, cells: Ints) -> Floats:
        """(3,) upper bounds, over cells (m, 3), of |dD/du|, |dD/dv| and |dD/dw|, at least 1.

        From the Bézier points of the cells.
        """
        part = np.unique(cells, axis=0)
        part = part[~self.still(part)]
        found = [hulls.longest() for hulls in slope_hulls(self, part, self.cell_bounds(part))]
        return np.concatenate([np.ones((1, 3)), *found]).max(axis=0)

    def least_weight(self, cells: Ints) -> float:
        """A number that the weight, of completed forms, nowhere in cells (m, 3) falls below."""
        part = np.unique(cells, axis=0)
        ends = self.cell_bounds(part)
        weights = self.restrict(part, ends[:, 0], ends[:, 1])
        found = weights.apply(self.net_kind.weight_part(self.net))
        return float(np.prod(found.min(axis=(0, 1, 2, 3))))

    def _leaves(self, points: Floats) -> Ints:
        tree = self.functions.tree
        units = np.floor((points - self.origin) / self.unit)
        top = (1 << tree.depth) - 1
        return tree.locate(np.clip(units, 0, top).astype(np.int64))


def _chebyshev_rows(at: Floats, degree: int, scale: Floats, *, slopes: bool) -> Floats:
    """Chebyshev polynomials (m, 1, k + 1) at places in [-1, 1]; with slopes (m, 2, k + 1)."""
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
