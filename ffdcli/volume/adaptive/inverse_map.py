"""The paper's embedding: points move with the parameters that the volume at rest gives them.

``D(x) = P1(u)`` with ``P0(u) = x`` (Song & Yang 2005, section 5), P0 the volume at rest and P1 the
edited one. It is evaluated as ``x + P1(u) - P0(u)``: what is left of solving for u then scales with
the edits, and the identity at rest is exact. The composed map is no quotient of polynomials, so
there are no Bézier points of it; `fitting.volume_fit` finds a volume that has some, near it.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cached_property
from typing import NoReturn

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.adaptive.parameters import Preimages, find_parameters
from ffdcli.volume.adaptive.volume import AdaptiveVolume

# Determinant of P0's derivative, as a share of its size cubed, below which it is not divided by.
_FLAT = 1e-9


class InvertedVolume(AdaptiveVolume):
    """A weighted volume whose deformation is taken at the parameters of each point.

    Points without parameters in the box, which the model must not have (see
    :func:`find_parameters`), move as the nearest place that has some.
    """

    @classmethod
    def of(cls, volume: AdaptiveVolume) -> InvertedVolume:
        """A weighted volume, embedded by the inverse instead of by displacement."""
        return cls(
            **{each.name: getattr(volume, each.name) for each in fields(volume) if each.init}
        )

    @cached_property
    def taken_in_place(self) -> AdaptiveVolume:
        """The same functions and net, ``x + P1(x) - P0(x)``: the displacement embedding."""
        held = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        return AdaptiveVolume(**held)

    def plain_map(self, points: Floats, weights: Floats) -> AdaptiveVolume:
        """The map ``P(u)`` itself; see :meth:`AdaptiveVolume.plain_map`."""
        return self.taken_in_place.plain_map(points, weights)

    def same_basis(self, other: object) -> bool:
        """True where the maps at rest agree too."""
        return (
            isinstance(other, InvertedVolume)
            and super().same_basis(other)
            and np.array_equal(self.rest_weights, other.rest_weights)
        )

    def parameters(self, points: Floats) -> Preimages:
        """Parameters of points (m, 3)."""
        return find_parameters(self.taken_in_place, points)

    def moves(self, points: Floats) -> tuple[Floats, Preimages]:
        """What points (m, 3) are moved by, (m, 3), and their parameters."""
        found = self.parameters(points)
        return self.taken_in_place.evaluate(found.parameters) - found.parameters, found

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, 3) of points (m, 3); the identity outside the box."""
        out = np.array(points, dtype=np.float64)
        for part in self._inside_chunks(points):
            out[part] += self.moves(points[part])[0]
        return out

    def linearise(self, points: Floats) -> tuple[Floats, Floats]:
        """Images (m, 3) and derivatives (m, 3, 3): ``I + (dQ/du) (dP0/du)^-1``, Q = P1 - P0."""
        images = np.array(points, dtype=np.float64)
        slopes = np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        for part in self._inside_chunks(points):
            found = self.parameters(points[part])
            moved, bent = self.taken_in_place.linearise(found.parameters)
            images[part] += moved - found.parameters
            size = np.linalg.norm(found.slopes, axis=(1, 2))
            regular = np.abs(np.linalg.det(found.slopes)) > _FLAT * size**3
            which = np.flatnonzero(regular)
            slopes[part[which]] += (bent[which] - np.eye(3)) @ np.linalg.inv(found.slopes[which])
        return images, slopes

    def basis_matrix(self, points: Floats) -> csr_array:
        """(m, n) sparse values of the functions at the parameters of points (m, 3) of the box."""
        return super().basis_matrix(self.parameters(points).parameters)

    def restrict(self, cells: Ints, low: Floats, high: Floats) -> NoReturn:
        """Refused: this map has no Bézier points."""
        raise TypeError("an inverted volume is no polynomial; fit one to it")
