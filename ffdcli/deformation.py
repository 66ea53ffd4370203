"""The deformation of a whole model: the maps of all lattice boxes, the identity elsewhere.

It is made once from a lattice and a mesh. All stages that need more of it than one map's
polynomials take it from here: images and derivatives of model points, breaks, degree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats, Ints

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.volume.protocol import BoxMap

# Points count as lying on a lattice box up to so many delta of the mesh beyond its sides.
_SLACK = 16.0


@dataclass(frozen=True)
class Breaks:
    """Planes of one lattice box across which the deformation is not one polynomial.

    Parameters
    ----------
    origin : (3,) float64, model length
    axes : (3, 3) float64
        Rows: the unit axes u, v, w of the lattice frame.
    values : three (n,) float64, values of u, v, w
        Knots and box sides; planes outside the mesh do no harm.
    """

    origin: Floats
    axes: Floats
    values: tuple[Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class Deformation:
    """The map of model points that one or more maps with disjoint boxes make up.

    Points on a box are deformed by its map. Points of the mesh lie there, and rounding must not
    carry them out: so a point no further beyond the sides of a box than ``slack`` gets the
    deformation at the nearest point of the box, continued by its derivative. Where boxes touch, a
    point belongs to the first; there both maps leave it where it is.

    Parameters
    ----------
    maps : tuple of BoxMap
    slack : (n, 2, 3) float64, model length
        Of each map's lower and upper sides.
    """

    maps: tuple[BoxMap, ...]
    slack: Floats

    @classmethod
    def of(cls, lattice: Lattice, delta: float) -> Deformation:
        """The deformation of a mesh by a lattice.

        Sides that the mesh crosses have no slack: the mesh goes on there, and stays as it is.

        Parameters
        ----------
        lattice : Lattice
        delta : float, model length
            The mesh's: the noise that may carry its points off a side.
        """
        sides = [[f"{axis}_{end}" for axis in "uvw"] for end in ("min", "max")]
        crossed = [np.isin(sides, list(member.crossed)) for member in lattice.members]
        return cls(lattice.maps, np.where(crossed, 0.0, _SLACK * delta))

    @classmethod
    def identity(cls) -> Deformation:
        """The deformation that moves nothing."""
        return cls((), np.zeros((0, 2, 3)))

    @property
    def alone(self) -> tuple[Deformation, ...]:
        """Each map's deformation by itself, continued from its box to all of space."""
        everywhere = np.full((1, 2, 3), np.inf)
        return tuple(Deformation((one,), everywhere) for one in self.maps)

    @property
    def degree(self) -> int:
        """Largest sum of a map's degrees along u, v and w."""
        return max((sum(one.degrees) for one in self.maps), default=1)

    @property
    def rational(self) -> bool:
        """Whether any of the maps is a quotient of polynomials."""
        return any(one.net_kind.rational for one in self.maps)

    @property
    def needs_fit(self) -> bool:
        """Whether any of the maps is neither piecewise polynomial nor piecewise rational."""
        return any(each.needs_fit for each in self.maps)

    @cached_property
    def breaks(self) -> tuple[Breaks, ...]:
        """Knot planes and box sides of each map."""
        found = []
        for one in self.maps:
            u, v, w = (_planes(one, axis) for axis in range(3))
            found.append(Breaks(one.frame.origin, one.frame.axes, (u, v, w)))
        return tuple(found)

    def images(self, points: Floats) -> Floats:
        """Images (n, 3) of model points (n, 3), by direct evaluation."""
        out = np.array(points, dtype=np.float64)
        for one, mine, local, beyond in self._by_box(points):
            images = one.evaluate(local)
            off = np.flatnonzero(beyond.any(axis=1))
            slopes = one.jacobian(local[off])
            images[off] += np.einsum("nij,nj->ni", slopes, beyond[off])
            out[mine] = one.frame.to_model(images)
        return out

    def boxes_of(self, points: Floats) -> Ints:
        """Number (n,) of the map that deforms each of the model points (n, 3); -1 for none."""
        out = np.full(len(points), -1, dtype=np.int64)
        for number, (_, mine, _, _) in enumerate(self._by_box(points)):
            out[mine] = number
        return out

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (n, 3, 3) at model points (n, 3): [i, j] is d D_i / d x_j."""
        out = np.tile(np.eye(3), (len(points), 1, 1))
        for one, mine, local, _ in self._by_box(points):
            slopes, frame = one.jacobian(local), one.frame
            # The frame's axes turn both sides.
            out[mine] = slopes if frame.aligned else frame.axes.T @ slopes @ frame.axes
        return out

    def count_pieces(self, points: Floats) -> Ints:
        """Upper bounds (m,) of the polynomial pieces that a segment in each hull may cross.

        Parameters
        ----------
        points : (m, n, 3) float64, model length
            Corners of each hull.
        """
        pieces = np.ones(len(points), dtype=np.int64)
        for one, breaks in zip(self.maps, self.breaks, strict=True):
            local = one.frame.to_local(points)
            low, high = local.min(axis=1), local.max(axis=1)
            for axis, planes in enumerate(breaks.values):
                first = np.searchsorted(planes, low[:, axis], side="right")
                last = np.searchsorted(planes, high[:, axis], side="left")
                pieces += np.maximum(0, last - first)
        return pieces

    def _by_box(self, points: Floats) -> Iterator[tuple[BoxMap, Ints, Floats, Floats]]:
        """Each map, which of the points (n, 3) it deforms, the nearest points of its box, and
        what the points lie beyond these; both in the map's frame.
        """
        free = np.ones(len(points), dtype=bool)
        for one, (below, above) in zip(self.maps, self.slack, strict=True):
            local = one.frame.to_local(points)
            nearest = np.clip(local, one.box[0], one.box[1])
            beyond = local - nearest
            mine = np.flatnonzero(free & ((beyond >= -below) & (beyond <= above)).all(axis=1))
            free[mine] = False
            yield one, mine, nearest[mine], beyond[mine]


def _planes(one: BoxMap, axis: int) -> Floats:
    """Knots within a map's box along an axis, and the box's ends, rising."""
    inner = one.knot_planes(axis, one.box[None]).values[0]
    return np.unique(np.concatenate([inner, one.box[:, axis]]))
