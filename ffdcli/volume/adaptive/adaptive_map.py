"""What all maps of functions on an octree have: control points, functions and their values.

T-spline and hierarchical maps differ in their functions and in what the net stands for. The
deformation displaces points, so it is the identity, to the last bit, wherever no function that
reaches the point is edited.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints, gather_runs
from ffdcli.splines.knots import KnotPlanes
from ffdcli.volume.adaptive.local_functions import LocalFunctions
from ffdcli.volume.boxes import in_box
from ffdcli.volume.frame import Frame
from ffdcli.volume.net_kind import NetKind

# Points evaluated at once: bounds the memory.
CHUNK_POINTS = 20_000
# Rounding allowed in the sum of a level's functions.
_COMPLETE = 1e-12


@dataclass(frozen=True)
class AdaptiveMap:
    """Control points and local functions of a map of the lattice box.

    Parameters
    ----------
    functions : LocalFunctions
    rest_points : (n, 3) float64, lattice frame
        Control points before any edit.
    rest_weights : (n,) float64
        Weights before any edit.
    levels : (n,) int64
        Level of the octree that each function belongs to; 0 is the coarsest.
    hidden : (n,) bool
        Control points that edits change only where they name them as hidden.
    net : (n, 3, 4 or 8) float64
        Coefficients of the functions; see :meth:`with_control`.
    origin, unit : (3,) float64, lattice frame
        Low corner of the octree that the functions' knots count from, and the finest unit.
    box : (2, 3) float64, lattice frame
        Outside it the deformation is the identity.
    frame : Frame
    weighted : bool
        True where the functions are weighted and only their quotients add up to 1.
    """

    functions: LocalFunctions
    rest_points: Floats
    rest_weights: Floats
    levels: Ints
    hidden: Bools
    net: Floats
    origin: Floats
    unit: Floats
    box: Floats
    frame: Frame
    weighted: bool

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Degree along u, v and w."""
        return self.functions.degrees

    @property
    def knots(self) -> None:
        """None: the map is no tensor product."""
        return None

    @property
    def shape(self) -> tuple[int]:
        """Number of control points."""
        return (self.functions.count,)

    @property
    def net_kind(self) -> NetKind:
        """How the net's polynomials become the deformation."""
        return NetKind(displaces=True, components=self.net.shape[1])

    @property
    def linear_precision(self) -> bool:
        """True for hierarchical functions; those of T-splines do not add up to the place."""
        return not self.weighted

    def with_net(self, net: Floats) -> Self:
        """The same map with another net."""
        return replace(self, net=net)

    def with_control(self, points: Floats, weights: Floats) -> Self:
        """The map with control points (n, 3) and weights (n,).

        Without weights the net holds the displacements of control points. With weights as at rest
        it is ``(w (P - P0), w)``: both quotients have one denominator. With others it holds both
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

    def same_basis(self, other: object) -> bool:
        """True where functions and frame agree, so that a plan serves both."""
        return (
            isinstance(other, AdaptiveMap)
            and type(other) is type(self)
            and self.degrees == other.degrees
            and self.net.shape == other.net.shape
            and all(
                np.array_equal(a, b)
                for a, b in zip(self.functions.knots, other.functions.knots, strict=True)
            )
            and np.array_equal(self.origin, other.origin)
            and np.array_equal(self.unit, other.unit)
            and self.frame.same(other.frame)
        )

    def knot_planes(self, axis: int, boxes: Floats) -> KnotPlanes:
        """Breaks (m, n) along ``axis`` within each of the boxes (m, 2, 3), NaN where fewer.

        The breaks are the sides of the polynomial cells in the box.
        """
        low = (boxes[:, 0] - self.origin) / self.unit
        high = (boxes[:, 1] - self.origin) / self.unit
        values = self.origin[axis] + self.functions.planes(axis, low, high) * self.unit[axis]
        smooth = np.full(values.shape, self.degrees[axis] - 1)
        return KnotPlanes(values, smooth)

    def complete_level(self, boxes: Floats) -> int | None:
        """The finest level whose functions add up to 1 all over boxes (m, 2, 3), lattice frame.

        Control points of that level alone can give any affine displacement there. None where the
        boxes reach out of the octree: no level is complete beyond it.
        """
        if np.any(boxes[:, 0] < self.box[0]) or np.any(boxes[:, 1] > self.box[1]):
            return None
        low, high = np.moveaxis((boxes - self.origin) / self.unit, 1, 0)
        leaves = np.unique(self.functions.tree.meeting(low, high)[1])
        of_level = np.eye(int(self.levels.max()) + 1)[self.levels]
        sums = self.functions.bezier_forms(leaves).apply(of_level, np.arange(len(leaves)))
        complete = np.abs(sums - 1).max(axis=(0, 1, 2, 3), initial=0.0) < _COMPLETE
        return int(np.flatnonzero(complete)[-1]) if complete.any() else None

    def contains(self, points: Floats) -> Bools:
        """(m,) True for points (m, 3) in the closed box."""
        return in_box(points, self.box)

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
        """Boxes on which each function is positive: corners (n, 3), (n, 3)."""
        low = self.origin + self.functions.low * self.unit
        high = self.origin + self.functions.high * self.unit
        return low, high

    def _leaves(self, points: Floats) -> Ints:
        """(m,) leaves that hold points (m, 3); the nearest one outside the octree."""
        tree = self.functions.tree
        units = np.floor((points - self.origin) / self.unit)
        top = (1 << tree.depth) - 1
        return tree.locate(np.clip(units, 0, top).astype(np.int64))
