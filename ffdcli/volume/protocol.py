"""What the stages after the volume may ask of it, whatever kind it is.

All points, boxes and control points are in the lattice frame.
"""

from __future__ import annotations

from typing import Protocol

from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.splines.knots import KnotPlanes
from ffdcli.volume.frame import Frame
from ffdcli.volume.net_kind import NetKind


class Restriction(Protocol):
    """The linear map from a control net to the Bézier points of many boxes, kept factored."""

    def take(self, part: Ints) -> Restriction:
        """The map to the boxes in ``part`` alone."""
        ...

    def at_low(self) -> Restriction:
        """The map to the first Bézier point of each box alone, its value at ``low``."""
        ...

    def apply(self, net: Floats, part: slice | Ints = ...) -> Floats:
        """Bézier points (m, ku + 1, kv + 1, kw + 1, c) of the boxes in ``part``.

        Or (m, 1, 1, 1, c) where the first is all that is left of them.
        """
        ...


class Volume(Protocol):
    """A piecewise polynomial or rational map of the lattice box."""

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Degree of the net's polynomials along u, v and w."""
        ...

    @property
    def net_kind(self) -> NetKind:
        """How the net's polynomials become the deformation."""
        ...

    @property
    def frame(self) -> Frame:
        """The frame whose coordinates are the parameters."""
        ...

    @property
    def box(self) -> Floats:
        """(2, 3) corners of the lattice box; outside it the deformation is the identity."""
        ...

    @property
    def net(self) -> Floats:
        """(..., c) what the basis functions are multiplied by."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """Of arrays with an entry per control point."""
        ...

    @property
    def rest_points(self) -> Floats:
        """(..., 3) control points before any edit."""
        ...

    @property
    def rest_weights(self) -> Floats:
        """(...) their weights then."""
        ...

    def with_control(self, points: Floats, weights: Floats) -> Volume:
        """The volume with control points (..., 3) and weights (...)."""
        ...

    @property
    def largest(self) -> float:
        """Largest coordinate that rounding is measured by."""
        ...

    def same_basis(self, other: object) -> bool:
        """True where a plan made for one volume serves the other."""
        ...

    def knot_planes(self, axis: int, boxes: Floats) -> KnotPlanes:
        """Breaks (m, n) along an axis strictly within each of the boxes (m, 2, 3)."""
        ...

    def cells(self, points: Floats) -> Ints:
        """(m, 3) identity of the polynomial cell that holds each point (m, 3)."""
        ...

    def cell_bounds(self, cells: Ints) -> Floats:
        """(m, 2, 3) corners of polynomial cells."""
        ...

    def restrict(self, cells: Ints, low: Floats, high: Floats) -> Restriction:
        """Bézier form of each cell's polynomial, continued if need be, on boxes (m, 3), (m, 3).

        Where ``low`` is above ``high`` it runs downwards along that axis.
        """
        ...

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3)."""
        ...

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): entry [i, j] is d D_i / d u_j."""
        ...

    def contains(self, points: Floats) -> Bools:
        """(m,) True for points (m, 3) in the closed box."""
        ...

    def still(self, cells: Ints) -> Bools:
        """(m,) True for cells (m, 3) on which the deformation is the identity to the last bit."""
        ...

    def slope_bounds(self, cells: Ints) -> Floats:
        """(3,) upper bounds, over cells, of the lengths of dD/du, dD/dv, dD/dw, at least 1."""
        ...

    def least_weight(self, cells: Ints) -> float:
        """A positive number that weights nowhere in the cells fall below."""
        ...

    def supports(self) -> tuple[Floats, Floats]:
        """Where each basis function is positive: corners (n, 3), (n, 3)."""
        ...

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse: images are this matrix times the control points, where weights are 1."""
        ...
