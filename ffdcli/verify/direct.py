"""Tensor-product volumes evaluated by scipy's B-splines, for verification only.

`ffd deform` composes Bézier forms of a control net (`ffdcli.splines`, `ffdcli.surface`). Here
`scipy.interpolate.NdBSpline` evaluates the same net and its derivatives point by point. An error in
the composition can therefore not appear on both sides of the comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.deformation import Deformation

if TYPE_CHECKING:
    from ffdcli.splines.knots import KnotPlanes
    from ffdcli.volume.frame import Frame
    from ffdcli.volume.net_kind import NetKind
    from ffdcli.volume.protocol import BoxMap


@dataclass(frozen=True)
class DirectMap:
    """The map of one lattice box: a polynomial or rational B-spline, the identity outside.

    Parameters
    ----------
    degrees : (int, int, int)
    knots : three float64 arrays, lattice-frame length
        Full knot vectors.
    net : (nu, nv, nw, 3 or 4) float64, lattice-frame length
        Control points; 4 components are homogeneous ``(wx, wy, wz, w)``.
    box : (2, 3) float64
    frame, net_kind, knot_planes
        As of the volume.
    """

    degrees: tuple[int, int, int]
    knots: tuple[Floats, Floats, Floats]
    net: Floats
    box: Floats
    frame: Frame
    net_kind: NetKind
    knot_planes: Callable[[int, Floats], KnotPlanes]
    needs_fit: bool = False

    @cached_property
    def _spline(self) -> Any:
        # Importing it takes a quarter of a second.
        from scipy.interpolate import NdBSpline

        return NdBSpline(self.knots, self.net, self.degrees)

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3)."""
        out = np.array(points, dtype=np.float64)
        inside = self._contains(points)
        values = self._spline(points[inside])
        out[inside] = values[:, :3] / values[:, 3:] if values.shape[1] == 4 else values
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3) at points (m, 3): [i, j] is d D_i / d u_j."""
        out = np.tile(np.eye(3), (len(points), 1, 1))
        inside = self._contains(points)
        at = points[inside]
        slopes = np.stack([self._spline(at, nu=order) for order in np.eye(3, dtype=int)], axis=2)
        if slopes.shape[1] == 4:
            values = self._spline(at)
            weight, image = values[:, 3:, None], values[:, :3, None] / values[:, 3:, None]
            slopes = (slopes[:, :3] - image * slopes[:, 3:]) / weight
        out[inside] = slopes
        return out

    def _contains(self, points: Floats) -> Bools:
        inside: Bools = np.all((points >= self.box[0]) & (points <= self.box[1]), axis=1)
        return inside


def evaluate_directly(deformation: Deformation) -> Deformation:
    """The same deformation, with every tensor-product volume evaluated by scipy.

    Adaptive volumes (T-splines, hierarchical splines) remain: scipy has none. They evaluate the
    Chebyshev form of each octree cell, computed from values of the basis functions by Cox and
    de Boor's recursion. The Bézier form that surfaces are made from comes from blossoms instead;
    both share the octree, the knots and the lists of functions on each cell, and the inverse map
    of embedded T-splines.
    """
    return replace(deformation, maps=tuple(map(_direct, deformation.maps)))


def _direct(volume: BoxMap) -> BoxMap:
    if volume.knots is None:
        return volume
    return DirectMap(
        volume.degrees,
        volume.knots,
        volume.net,
        volume.box,
        volume.frame,
        volume.net_kind,
        volume.knot_planes,
    )
