"""What the stages after the volume may ask of it, whatever kind it is.

All points, boxes and control points are in the lattice frame.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ffdcli.volume.frame import Frame
from ffdcli.volume.knots import KnotPlanes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Restriction(Protocol):
    """The linear map from a control net to the Bézier points of many boxes, kept factored."""

    def take(self, part: Ints) -> Restriction:
        """The map to the boxes in ``part`` alone."""
        ...

    def apply(self, net: Floats, part: slice | Ints = ...) -> Floats:
        """Bézier points (m, ku + 1, kv + 1, kw + 1, 3 or 4) of the boxes in ``part``."""
        ...


class Volume(Protocol):
    """A piecewise polynomial (or, with 4 components, rational) map of the lattice box."""

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Degree along u, v and w."""
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
        """Control points, homogeneous where there are 4 components."""
        ...

    def knot_planes(self, axis: int, box: Floats) -> KnotPlanes:
        """Breaks along an axis within ``box`` (2, 3)."""
        ...

    def cells(self, points: Floats) -> Ints:
        """(m, 3) identity of the polynomial cell that holds each point (m, 3)."""
        ...

    def cell_bounds(self, cells: Ints) -> Floats:
        """(m, 2, 3) corners of polynomial cells."""
        ...

    def restrict(self, cells: Ints, low: Floats, high: Floats) -> Restriction:
        """Bézier form of each cell's polynomial, continued if need be, on boxes (m, 3), (m, 3)."""
        ...

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3)."""
        ...

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): entry [i, j] is d D_i / d u_j."""
        ...

    def slope_bounds(self) -> Floats:
        """(3,) upper bounds of the lengths of dD/du, dD/dv and dD/dw, at least 1."""
        ...

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse: images are this matrix times the control points, where weights are 1."""
        ...
