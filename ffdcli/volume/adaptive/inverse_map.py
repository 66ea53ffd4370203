"""The embedding of Song & Yang: points move with the parameters of the map at rest.

``D(x) = P1(u)`` with ``P0(u) = x`` (Song & Yang 2005, section 5), P0 the map at rest and P1 the
edited one. It is evaluated as ``x + P1(u) - P0(u)``: the error of solving for u then scales with
the edits, and the identity at rest is exact. The composed map is no quotient of polynomials, so it
has no Bézier points; `fitting.volume_fit` finds a volume near it.

P0 takes the box into itself: no function but those of the box's own corners begins at its sides, so
their quotients stay a fifth of a cell or more inside. Points between the box and its image have no
parameters, and D is the identity there, as it is outside the box. It joins P1 - P0 with C2 across
the images of sides whose control points are all at rest; across others it is torn.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats
from ffdcli.volume.adaptive.adaptive_map import CHUNK_POINTS, AdaptiveMap
from ffdcli.volume.adaptive.parameters import Preimages, find_parameters
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.boxes import parts_in_box
from ffdcli.volume.protocol import Volume

# Determinant of the derivative of P0, relative to its norm cubed, below which it is singular.
_FLAT = 1e-9
# Displacements that count as rounding, relative to the largest coordinate.
_STILL = 1e-12


@dataclass(frozen=True)
class InverseMap(AdaptiveMap):
    """The map of a weighted volume whose displacement is taken at the parameters of each point.

    Points without parameters in the box (see :func:`find_parameters`) stay.
    """

    @classmethod
    def of(cls, volume: AdaptiveVolume) -> InverseMap:
        """A weighted volume, embedded by the inverse instead of by displacement."""
        return cls(**_shared_fields(volume))

    @property
    def needs_fit(self) -> Literal[True]:
        """True."""
        return True

    @cached_property
    def displacement(self) -> AdaptiveVolume:
        """The same functions and net, ``x + P1(x) - P0(x)``: the displacement embedding."""
        return AdaptiveVolume(**_shared_fields(self))

    def same_basis(self, other: object) -> bool:
        """True where the maps at rest agree too."""
        return (
            isinstance(other, InverseMap)
            and super().same_basis(other)
            and np.array_equal(self.rest_weights, other.rest_weights)
        )

    def parameters(self, points: Floats) -> Preimages:
        """Parameters of points (m, 3)."""
        return find_parameters(self.displacement, points)

    def has_parameters(self, points: Floats) -> Bools:
        """(m,) True for points (m, 3) that have parameters in the box."""
        return self.parameters(points).solved

    def moves(self, found: Preimages) -> Floats:
        """Displacements (m, 3) of points with these parameters; 0 where they have none."""
        return np.where(found.solved[:, None], self._moves_at(found.parameters), 0.0)

    def torn(self, found: Preimages) -> Bools:
        """(m,) True for points without parameters beside which the deformation does not vanish.

        Those are points beyond the image of a side whose control points move, and points within
        the image for which no parameters were found.
        """
        lost = np.flatnonzero(~found.solved)
        at = found.parameters[lost]
        moved = np.abs(self._moves_at(at)).max(axis=1) > _STILL * self.displacement.largest
        within = np.all((at > self.box[0]) & (at < self.box[1]), axis=1)
        out = np.zeros(len(found.solved), dtype=bool)
        out[lost] = moved | within
        return out

    def _moves_at(self, parameters: Floats) -> Floats:
        return self.displacement.evaluate(parameters) - parameters

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3); the identity outside the box."""
        out = np.array(points, dtype=np.float64)
        for part in parts_in_box(points, self.box, CHUNK_POINTS):
            out[part] += self.moves(self.parameters(points[part]))
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (m, 3, 3): ``I + (dQ/du) (dP0/du)^-1``, Q = P1 - P0."""
        slopes = np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        for part in parts_in_box(points, self.box, CHUNK_POINTS):
            found = self.parameters(points[part])
            bent = self.displacement.jacobian(found.parameters)
            size = np.linalg.norm(found.slopes, axis=(1, 2))
            regular = np.abs(np.linalg.det(found.slopes)) > _FLAT * size**3
            which = np.flatnonzero(regular & found.solved)
            slopes[part[which]] += (bent[which] - np.eye(3)) @ np.linalg.inv(found.slopes[which])
        return slopes

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse values of the functions at the parameters of points (m, 3) of the box."""
        return super().basis_matrix(self.parameters(points).parameters)


# The map of any lattice: `needs_fit` tells which of the two it is.
AnyMap = Volume | InverseMap


def _shared_fields(one: AdaptiveMap) -> dict[str, Any]:
    return {each.name: getattr(one, each.name) for each in fields(AdaptiveMap)}
