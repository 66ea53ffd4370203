"""What later stages may ask of the map of a lattice box, whatever its kind.

All points, boxes and control points are in the lattice frame. Control points are numbered along
one axis (octrees) or three (tensor products): ``shape`` tells which.
"""

from __future__ import annotations

from typing import Literal, Protocol

from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.splines.knots import KnotPlanes
from ffdcli.splines.local_sums import LocalSums
from ffdcli.splines.tensor_products import TensorRestriction
from ffdcli.volume.frame import Frame
from ffdcli.volume.net_kind import NetKind


class Restriction(Protocol):
    """The linear map from a control net to the Bézier points of many boxes, kept factored."""

    @property
    def as_tensor(self) -> TensorRestriction | None:
        """The same map as small matrices per axis; None where the volume is no tensor product."""
        ...

    @property
    def growth(self) -> Floats:
        """(m,) largest sum of the absolute weights of a Bézier point of each box, at least 1.

        Displacements and rounding errors of control points, on octrees of the Bézier points of the
        cell, grow by no more than this.
        """
        ...

    def take(self, part: Ints) -> Restriction:
        """The map to the boxes in ``part`` alone."""
        ...

    def apply(self, net: Floats, part: slice | Ints = ...) -> Floats:
        """Bézier points (m, ku + 1, kv + 1, kw + 1, c) of the boxes in ``part``.

        After :meth:`Volume.at_points` (m, 1, 1, 1, c).
        """
        ...


class BoxMap(Protocol):
    """A map of points of the lattice box; the identity outside the box."""

    @property
    def needs_fit(self) -> bool:
        """True where the map has no polynomial or rational pieces: it is no :class:`Volume`."""
        ...

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
        """(2, 3) corners of the lattice box."""
        ...

    @property
    def knots(self) -> tuple[Floats, Floats, Floats] | None:
        """Knot vectors along u, v and w of a tensor product; None for other maps."""
        ...

    @property
    def net(self) -> Floats:
        """(..., c) coefficients of the basis functions."""
        ...

    def knot_planes(self, axis: int, boxes: Floats) -> KnotPlanes:
        """Breaks (m, n) of the functions along an axis strictly within boxes (m, 2, 3)."""
        ...

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3)."""
        ...

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): entry [i, j] is d D_i / d u_j."""
        ...


class LatticeMap(BoxMap, Protocol):
    """A map of the lattice box, linear in its control points; the identity outside the box."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of arrays with one entry per control point."""
        ...

    @property
    def rest_points(self) -> Floats:
        """(..., 3) control points before any edit."""
        ...

    @property
    def rest_weights(self) -> Floats:
        """(...) weights before any edit."""
        ...

    @property
    def levels(self) -> Ints:
        """(...) level of each control point; 0 is the coarsest, or the only one."""
        ...

    @property
    def hidden(self) -> Bools:
        """(...) control points that edits change only where they name them as hidden."""
        ...

    @property
    def linear_precision(self) -> bool:
        """True where the control points at rest, combined by the functions, give the identity.

        Then control points that share a rigid motion move what they reach by that motion.
        """
        ...

    def complete_level(self, boxes: Floats) -> int | None:
        """The finest level whose functions add up to 1 all over boxes (m, 2, 3).

        Control points of that level alone can give any affine displacement there. None where the
        boxes reach out of the region of the functions.
        """
        ...

    def with_control(self, points: Floats, weights: Floats) -> LatticeMap:
        """The map with control points (..., 3) and weights (...)."""
        ...

    def same_basis(self, other: object) -> bool:
        """True where a plan made for one map serves the other."""
        ...

    def contains(self, points: Floats) -> Bools:
        """(m,) True for points (m, 3) in the closed box."""
        ...

    def has_parameters(self, points: Floats) -> Bools:
        """(m,) True for points (m, 3) of the box where the map is defined."""
        ...

    def supports(self) -> tuple[Floats, Floats]:
        """Boxes on which the basis functions are positive: corners (n, 3), (n, 3)."""
        ...

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse values of the basis functions at points (m, 3)."""
        ...


class Volume(LatticeMap, Protocol):
    """A map whose pieces are polynomials or quotients of polynomials in Bézier form."""

    @property
    def needs_fit(self) -> Literal[False]:
        """False."""
        ...

    @property
    def largest(self) -> float:
        """Largest coordinate that rounding errors are measured by."""
        ...

    def with_control(self, points: Floats, weights: Floats) -> Volume:
        """The volume with control points (..., 3) and weights (...)."""
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

    def at_points(self, cells: Ints, points: Floats) -> Restriction:
        """Value of each cell's polynomial, continued if need be, at a point (m, 3)."""
        ...

    def slope_sums(self, points: Floats) -> LocalSums | None:
        """Derivatives of the net's polynomials at points (m, 3) as sums of control points.

        Row ``3 i + a`` is the derivative along axis ``a`` at point ``i``. None where the volume is
        no tensor product.
        """
        ...

    def is_identity(self, cells: Ints) -> Bools:
        """(m,) True for cells (m, 3) on which the deformation is the identity to the last bit."""
        ...

    def slope_bounds(self, cells: Ints) -> Floats:
        """(3,) upper bounds, over cells, of the lengths of dD/du, dD/dv, dD/dw, at least 1."""
        ...

    def least_weight(self, cells: Ints) -> float:
        """A positive lower bound of the weights in the cells."""
        ...
