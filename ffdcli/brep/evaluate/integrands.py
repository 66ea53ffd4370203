"""What is integrated over faces, and how many points are evaluated at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import SurfaceBatch

# Points evaluated at once.
POINTS = 16384

# (points (..., 3), cross products of tangents (..., 3)) -> integrands (..., k)
Integrand = Callable[[Floats, Floats], Floats]
# Numbers of Gauss points along the two parameters of a region.
Rule = tuple[int, int]


class Regions(Protocol):
    """Regions of surface parameters that add up, with their signs, to the inside of faces.

    Each is the image of a unit square and lies in one polynomial piece of its surface.
    """

    @property
    def batch(self) -> SurfaceBatch:
        """The surfaces."""

    @property
    def row(self) -> Ints:
        """(n,) surface in the batch of each region."""

    def rules(self, exact: bool) -> list[Rule]:
        """Rules of rising order.

        The last one is exact for fluxes of polynomial surfaces; if it is not ``exact``, as the
        integrand is no polynomial, one of twice its points follows.
        """

    def amounts(self, rows: Ints, shares: Floats, rule: Rule, integrand: Integrand) -> Floats:
        """(m, k) integrals over parts (m, 2, 2) of the squares of regions ``rows`` by one rule."""


def cross(first: Floats, second: Floats) -> Floats:
    """Cross products (..., 3); several times faster than ``np.cross``."""
    a, b, c = np.moveaxis(first, -1, 0)
    d, e, f = np.moveaxis(second, -1, 0)
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)
