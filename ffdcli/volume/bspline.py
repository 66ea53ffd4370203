"""Tensor-product B-spline volumes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.splines.knots import (
    KnotPlanes,
    blossom_weights,
    find_spans,
    greville,
    knot_planes,
    restriction_weights,
    value_weights,
)
from ffdcli.splines.local_sums import LocalSums, collect_sums
from ffdcli.splines.tensor_products import TensorRestriction
from ffdcli.volume.boxes import in_box, parts_in_box
from ffdcli.volume.frame import Frame
from ffdcli.volume.net_kind import NetKind
from ffdcli.volume.weights import homogeneous

# Points evaluated at once: bounds the memory of the gathered control points.
_CHUNK = 4096


@dataclass(frozen=True)
class BSplineVolume:
    """A B-spline volume ``D(u, v, w) = sum P_ijk N_i(u) N_j(v) N_k(w)`` (Feng et al. 2002, Eq. 1).

    Parameters
    ----------
    degrees : (int, int, int)
    knots : three float64 arrays, lattice-frame length
        Full knot vectors, ``n_a + k_a + 1`` values each.
    net : (nu, nv, nw, 3 or 4) float64, lattice-frame length
        Control points; 4 components are homogeneous ``(wx, wy, wz, w)``.
    frame : Frame
    """

    degrees: tuple[int, int, int]
    knots: tuple[Floats, Floats, Floats]
    net: Floats
    frame: Frame

    @property
    def needs_fit(self) -> Literal[False]:
        """False."""
        return False

    @cached_property
    def box(self) -> Floats:
        """(2, 3) corners of the lattice box."""
        ends = [(t[k], t[len(t) - k - 1]) for t, k in zip(self.knots, self.degrees, strict=True)]
        return np.array(ends).T

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of control points along u, v and w."""
        nu, nv, nw = self.net.shape[:3]
        return nu, nv, nw

    @cached_property
    def rest_points(self) -> Floats:
        """(nu, nv, nw, 3) Greville abscissae: with these control points the map is the identity."""
        axes = [greville(t, k) for t, k in zip(self.knots, self.degrees, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    @cached_property
    def rest_weights(self) -> Floats:
        """(nu, nv, nw) weights before any edit: 1."""
        return np.ones(self.shape)

    @cached_property
    def levels(self) -> Ints:
        """(nu, nv, nw) 0: there is one level."""
        return np.zeros(self.shape, dtype=np.int64)

    @cached_property
    def hidden(self) -> Bools:
        """(nu, nv, nw) False: edits may change all control points."""
        return np.zeros(self.shape, dtype=bool)

    @property
    def linear_precision(self) -> bool:
        """True, by the choice of the Greville abscissae (Feng et al. 2002, section 3.1)."""
        return True

    def complete_level(self, boxes: Floats) -> int:
        """0: the functions of the only level add up to 1 (and to 0 outside the box)."""
        return 0

    def with_control(self, points: Floats, weights: Floats) -> BSplineVolume:
        """The volume with control points (nu, nv, nw, 3) and weights (nu, nv, nw)."""
        return self.with_net(homogeneous(points, weights))

    def with_net(self, net: Floats) -> BSplineVolume:
        """The same volume with another control net (nu, nv, nw, 3 or 4)."""
        return replace(self, net=net)

    def same_basis(self, other: object) -> bool:
        """True where degrees, knots and frame agree, so that a plan serves both."""
        return (
            isinstance(other, BSplineVolume)
            and self.degrees == other.degrees
            and all(np.array_equal(a, b) for a, b in zip(self.knots, other.knots, strict=True))
            and self.frame.same(other.frame)
        )

    @property
    def net_kind(self) -> NetKind:
        """How the net's polynomials become the deformation."""
        return NetKind(displaces=False, components=self.net.shape[3])

    @property
    def largest(self) -> float:
        """Largest coordinate of the control points."""
        points = self.net[..., :3]
        return float(np.abs(points / self.net[..., 3:] if self.net_kind.rational else points).max())

    def knot_planes(self, axis: int, boxes: Floats) -> KnotPlanes:
        """Breaks (m, n) along ``axis`` strictly within boxes (m, 2, 3), with their continuity."""
        planes = knot_planes(self.knots[axis], self.degrees[axis])
        values = np.broadcast_to(planes.values, (len(boxes), len(planes.values)))
        within = (values > boxes[:, :1, axis]) & (values < boxes[:, 1:, axis])
        return KnotPlanes(
            np.where(within, values, np.nan), np.broadcast_to(planes.continuity, values.shape)
        )

    def cells(self, points: Floats) -> Ints:
        """(m, 3) knot spans along u, v and w of points (m, 3)."""
        spans = [
            find_spans(t, k, points[:, axis])
            for axis, (t, k) in enumerate(zip(self.knots, self.degrees, strict=True))
        ]
        return np.stack(spans, axis=-1)

    def cell_bounds(self, cells: Ints) -> Floats:
        """(m, 2, 3) corners of knot boxes (m, 3)."""
        low = [t[cells[:, axis]] for axis, t in enumerate(self.knots)]
        high = [t[cells[:, axis] + 1] for axis, t in enumerate(self.knots)]
        return np.stack([np.stack(low, axis=-1), np.stack(high, axis=-1)], axis=1)

    def restrict(self, cells: Ints, low: Floats, high: Floats) -> TensorRestriction:
        """Bézier form of each knot box's polynomial on the box [low, high] (m, 3)."""
        return self._restricted(cells, (low, high), restriction_weights)

    def at_points(self, cells: Ints, points: Floats) -> TensorRestriction:
        """Value of each knot box's polynomial, continued if need be, at a point (m, 3).

        The generalised de Boor-Cox algorithm of Feng et al. 2002, section 3.4.2.
        """
        return self._restricted(cells, (points,), value_weights)

    def _restricted(
        self, cells: Ints, ends: tuple[Floats, ...], matrices: Callable[..., Floats]
    ) -> TensorRestriction:
        """The map to the forms that ``matrices`` makes between ``ends``, axis by axis."""
        weights = [
            np.ascontiguousarray(
                np.moveaxis(matrices(t, k, cells[:, axis], *(end[:, axis] for end in ends)), 0, -1)
            )
            for axis, (t, k) in enumerate(zip(self.knots, self.degrees, strict=True))
        ]
        first = cells - np.array(self.degrees)
        return TensorRestriction(first, (weights[0], weights[1], weights[2]))

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3); the identity outside the box."""
        out = np.array(points, dtype=np.float64)
        flat = self.net.reshape(-1, self.net.shape[3])
        for part in parts_in_box(points, self.box, _CHUNK):
            out[part] = self.net_kind.images(self.basis_matrix(points[part]) @ flat, points[part])
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): [i, j] is d D_i / d u_j; identity outside."""
        out = np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        for part in parts_in_box(points, self.box, _CHUNK):
            out[part] = self.net_kind.slopes(*self._with_derivatives(points[part]))
        return out

    def slope_sums(self, points: Floats) -> LocalSums:
        """Matrices from the net to the derivatives of its B-spline at points (m, 3) of the box.

        Row ``3 i + a`` gives the derivative along axis ``a`` at point ``i``.
        """
        both = self._values_and_slopes(points)
        every = np.arange(len(points))

        def rows() -> Iterator[tuple[Ints, Floats]]:
            for axis in range(3):
                u, v, w = (weights[int(a == axis) :][:1] for a, weights in enumerate(both.weights))
                along = TensorRestriction(both.first, (u, v, w)).matrices(every)
                yield 3 * every + axis, along[:, 0, 0, 0]

        return collect_sums(self.degrees, both.first, np.repeat(every, 3), rows())

    def _with_derivatives(self, points: Floats) -> tuple[Floats, Floats]:
        """Values (m, c) and derivatives (m, c, 3) of the homogeneous volume, axis by axis."""
        all_three = self._values_and_slopes(points).apply(self.net)
        orders = [all_three[:, 1, 0, 0], all_three[:, 0, 1, 0], all_three[:, 0, 0, 1]]
        return all_three[:, 0, 0, 0], np.stack(orders, axis=-1)

    def _values_and_slopes(self, points: Floats) -> TensorRestriction:
        """Values (row 0) and derivatives (row 1) along each axis at points (m, 3)."""
        pairs = [
            _axis_slopes(t, k, points[:, axis])
            for axis, (t, k) in enumerate(zip(self.knots, self.degrees, strict=True))
        ]
        first = np.stack([start for start, _ in pairs], axis=-1)
        u, v, w = (np.ascontiguousarray(np.moveaxis(both, 0, -1)) for _, both in pairs)
        return TensorRestriction(first, (u, v, w))

    def least_weight(self, cells: Ints) -> float:
        """The least weight of all control points: a lower bound of W, which is a mean of them."""
        return float(self.net[..., 3].min())

    def is_identity(self, cells: Ints) -> Bools:
        """(m,) False: at rest the sums of control points give the identity with rounding only."""
        return np.zeros(len(cells), dtype=bool)

    def slope_bounds(self, cells: Ints) -> Floats:
        """(3,) upper bounds of |dD/du|, |dD/dv| and |dD/dw| over the box, at least 1.

        With weights 1 the derivative is a B-spline whose control points are scaled differences of
        the net; it lies in their hull. With weights, for X = W D,
        ``W D' = X' - D W' = sum k/span_i N_i (w_{i+1} (P_{i+1} - P_i) + (w_{i+1} - w_i)(P_i - D))``
        is bounded term by term: D lies in the hull of the control points that reach it, and W is at
        least their least weight.
        """
        points, weights = self.net, np.ones(self.net.shape[:3])
        if self.net.shape[3] == 4:
            points, weights = self.net[..., :3] / self.net[..., 3:], self.net[..., 3]
        least = _over_neighbours(np.min, weights, self.degrees)
        corners = _over_neighbours(np.max, points, self.degrees)
        corners -= _over_neighbours(np.min, points, self.degrees)
        hull = np.linalg.norm(corners, axis=-1)
        bounds = np.ones(3)
        for axis, (t, k) in enumerate(zip(self.knots, self.degrees, strict=True)):
            span = t[1 + k : -1] - t[1 : -1 - k]
            steps = np.linalg.norm(np.diff(points, axis=axis), axis=-1)
            low, high = (
                tuple(part if a == axis else slice(None) for a in range(3))
                for part in (slice(None, -1), slice(1, None))
            )
            numerator = weights[high] * steps + np.abs(np.diff(weights, axis=axis)) * hull[low]
            ratio = numerator / np.minimum(least[low], least[high])
            moved = np.moveaxis(ratio, axis, -1)[..., span > 0] / span[span > 0]
            bounds[axis] = max(1.0, k * float(moved.max(initial=0.0)))
        return bounds

    def supports(self) -> tuple[Floats, Floats]:
        """Boxes on which each basis function is positive: corners (n, 3), (n, 3).

        A basis function is zero at the ends of its support, except at the ends of the lattice box.
        So the boxes are enlarged by the rounding error there, and reduced by it elsewhere.
        """
        slack = 4 * np.finfo(np.float64).eps * float(np.abs(self.box).max())
        lows, highs = [], []
        for axis, (knots, degree) in enumerate(zip(self.knots, self.degrees, strict=True)):
            low, high = self.box[:, axis]
            start, end = knots[: -degree - 1], knots[degree + 1 :]
            # With clamped ends the first function has its first degree + 1 knots on the side.
            open_low = (start < low) | (knots[degree:-1] == low)
            open_high = (end > high) | (knots[1:-degree] == high)
            lows.append(np.where(open_low, low - slack, start + slack))
            highs.append(np.where(open_high, high + slack, end - slack))
        first = np.stack(np.meshgrid(*lows, indexing="ij"), axis=-1).reshape(-1, 3)
        last = np.stack(np.meshgrid(*highs, indexing="ij"), axis=-1).reshape(-1, 3)
        return first, last

    def contains(self, points: Floats) -> Bools:
        """(m,) True for points in the closed lattice box."""
        return in_box(points, self.box)

    def has_parameters(self, points: Floats) -> Bools:
        """(m,) True: points are their own parameters."""
        return np.ones(len(points), dtype=bool)

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, nu nv nw) sparse basis functions at points (m, 3) of the box, w fastest."""
        pairs = [
            _axis_basis(t, k, points[:, axis])
            for axis, (t, k) in enumerate(zip(self.knots, self.degrees, strict=True))
        ]
        weights = [pair[1] for pair in pairs]
        offsets = [
            start[:, None] + np.arange(k + 1)[None, :]
            for (start, _), k in zip(pairs, self.degrees, strict=True)
        ]
        _, nv, nw = self.shape
        columns = (offsets[0][:, :, None, None] * nv + offsets[1][:, None, :, None]) * nw + offsets[
            2
        ][:, None, None, :]
        values = np.einsum("mi,mj,mk->mijk", *weights)
        count = values[0].size if len(points) else 0
        rows = np.arange(len(points) + 1) * count
        shape = (len(points), int(np.prod(self.shape)))
        return csr_array((values.ravel(), columns.reshape(-1), rows), shape=shape)


def _over_neighbours(
    choose: Callable[..., Floats], values: Floats, degrees: Sequence[int]
) -> Floats:
    """Least or largest values (nu, nv, nw, ...) within ``degree`` neighbours along each axis."""
    for axis, k in enumerate(degrees):
        ends = [(k, k) if each == axis else (0, 0) for each in range(values.ndim)]
        padded = np.pad(values, ends, mode="edge")
        values = choose(sliding_window_view(padded, 2 * k + 1, axis=axis), axis=-1)
    return values


def _axis_basis(knots: Floats, degree: int, values: Floats) -> tuple[Ints, Floats]:
    """Index (m,) of the first non-zero basis function, and the non-zero ones (m, degree + 1)."""
    # Imported late: the import loads scipy's optimisers, which runs that only deform do not need.
    from scipy.interpolate import BSpline

    if not len(values):
        return np.empty(0, dtype=np.int64), np.empty((0, degree + 1))
    matrix = BSpline.design_matrix(values, knots, degree)
    weights = matrix.data.reshape(len(values), degree + 1)
    return matrix.indices.reshape(len(values), degree + 1)[:, 0].astype(np.int64), weights


def _axis_slopes(knots: Floats, degree: int, values: Floats) -> tuple[Ints, Floats]:
    """Index (m,) of the first non-zero function; functions and slopes (m, 2, degree + 1)."""
    spans = find_spans(knots, degree, values)
    equal = np.repeat(values[:, None], degree, axis=1)
    both = np.zeros((len(values), 2, degree + 1))
    both[:, 0] = blossom_weights(knots, degree, spans, equal)
    index = (spans - degree)[:, None] + np.arange(degree)
    slopes = degree * blossom_weights(knots[1:-1], degree - 1, spans - 1, equal[:, 1:])
    slopes /= knots[index + degree + 1] - knots[index + 1]
    both[:, 1, :-1] -= slopes
    both[:, 1, 1:] += slopes
    return spans - degree, both
