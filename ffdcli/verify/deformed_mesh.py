"""The deformed mesh: its triangles under a deformation, and points spread over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks
from ffdcli.deformation import Breaks

# Largest number of triangles that each get a sample.
OWN_SAMPLES = 200_000
# Points evaluated at once.
POINTS = 65_536


class ModelMap(Protocol):
    """A deformation of model points, such as :class:`ffdcli.deformation.Deformation`."""

    @property
    def breaks(self) -> Sequence[Breaks]:
        """Planes across which the deformation is not one polynomial."""
        ...

    @property
    def alone(self) -> Sequence[ModelMap]:
        """The deformation inside each lattice box, continued smoothly beyond it.

        The deformation itself may jump at a side of a box, and then has no inverse there.
        """
        ...

    @property
    def degree(self) -> int:
        """Total degree: the largest sum of degrees along three lattice axes."""
        ...

    @property
    def rational(self) -> bool:
        """Whether it is a quotient of polynomials."""
        ...

    @property
    def needs_fit(self) -> bool:
        """Whether it is neither piecewise polynomial nor piecewise rational."""
        ...

    def images(self, points: Floats) -> Floats:
        """Images (n, 3) of points (n, 3)."""
        ...

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (n, 3, 3): entry [i, j] is that of coordinate i along j."""
        ...


@dataclass(frozen=True)
class DeformedMesh:
    """A triangle mesh under a deformation.

    Parameters
    ----------
    corners : (T, 3, 3) float64, model length
        Undeformed triangles.
    neighbours : (T, 3) int64
        Triangle across each side (side i starts at corner i), -1 where there is none.
    deformation : ModelMap
    """

    corners: Floats
    neighbours: Ints
    deformation: ModelMap

    def at(self, triangle: Ints, params: Floats) -> Floats:
        """Undeformed points (n, 3) of triangles at parameters (n, 2)."""
        corner = self.corners[triangle]
        arm = params[:, :, None] * (corner[:, 1:] - corner[:, :1])
        points: Floats = corner[:, 0] + arm.sum(axis=1)
        return points

    def params_of(self, triangle: Ints, points: Floats) -> Floats:
        """Parameters (n, 2) on triangles of the points nearest to undeformed points (n, 3)."""
        sides = self.corners[triangle, 1:] - self.corners[triangle, :1]
        arm = points - self.corners[triangle, 0]
        params: Floats = np.einsum("nij,nj->ni", np.linalg.pinv(np.swapaxes(sides, 1, 2)), arm)
        return params

    def on_triangles(self, triangle: Ints, params: Floats) -> tuple[Floats, Floats]:
        """Images of points of triangles: positions (n, 3) and tangents (n, 2, 3)."""
        sides = self.corners[triangle, 1:] - self.corners[triangle, :1]
        points = self.at(triangle, params)
        position, tangents = np.empty((len(points), 3)), np.empty((len(points), 2, 3))
        for part in chunks(len(points), POINTS):
            position[part] = self.deformation.images(points[part])
            tangents[part] = sides[part] @ np.swapaxes(
                self.deformation.jacobian(points[part]), 1, 2
            )
        return position, tangents


def spread_over(image: DeformedMesh, wanted: int) -> tuple[Ints, Floats]:
    """Spread points over the undeformed triangles by area, the same on every run.

    Up to ``OWN_SAMPLES`` triangles get at least one point each.

    Returns
    -------
    triangle : (n,) int64
    params : (n, 2) float64
        The point is ``p0 + a (p1 - p0) + b (p2 - p0)``.
    """
    sides = image.corners[:, 1:] - image.corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    random = np.random.default_rng(0)
    count = len(area)
    own = random.permutation(count)[:OWN_SAMPLES]
    share = area / area.sum() if area.sum() > 0 else np.full(count, 1 / max(count, 1))
    more = random.choice(count, size=wanted, p=share) if count else own
    triangle = np.sort(np.concatenate([own, more]))
    params = random.random((len(triangle), 2))
    outside = params.sum(axis=1) > 1
    params[outside] = 1 - params[outside]
    return triangle, params
