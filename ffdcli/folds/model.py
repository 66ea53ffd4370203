"""The part of the model in a lattice box: its surface there, and the inside of closed bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh import Mesh, ShellNesting, triangles
from ffdcli.mesh.winding import nearest_on_triangles, winding_numbers
from ffdcli.splines.local_sums import LocalSums
from ffdcli.volume.convex_overlap import touches_boxes, triangle_directions
from ffdcli.volume.protocol import LatticeMap, Volume

# Points spread over the surface, to measure how much of it is folded.
SPREAD = 10_000
# Pairs of a box and a triangle compared at a time.
_PAIRS = 2_000_000
# Up to so many pairs the exact test costs less than the pairs it removes.
_CLOSELY = 50_000


@dataclass(frozen=True)
class ModelInBox:
    """A mesh in the box of a lattice: a :class:`~ffdcli.folds.domain.SearchDomain`.

    Parameters
    ----------
    vertices : (V, 3) float64, lattice frame
    triangles : (T, 3) int64
    solid : (T,) bool
        Triangles of closed bodies, whose inside is part of the model.
    box : (2, 3) float64, lattice frame
        The lattice box.
    slack : float
        Distance within which a point counts as lying in the box.
    sums : LocalSums or None
        Matrices from the net to the derivatives at the samples; see :meth:`with_matrices`.
    """

    vertices: Floats
    triangles: Ints
    solid: Bools
    box: Floats
    slack: float
    sums: LocalSums | None = None

    def with_matrices(self, volume: Volume) -> ModelInBox:
        """The model with :attr:`sums`, where the volume is a polynomial tensor product."""
        if volume.net_kind.rational:
            return self
        return replace(self, sums=volume.slope_sums(self.samples))

    @cached_property
    def corners(self) -> Floats:
        """(T, 3, 3) corners of the triangles."""
        return self.vertices[self.triangles]

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) intersection of the mesh's box with the lattice box."""
        low, high = self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))
        return np.clip([low - self.slack, high + self.slack], self.box[0], self.box[1])

    @property
    def empty(self) -> bool:
        """True where the mesh lies outside the lattice box."""
        return bool(np.any(self.bounds[0] >= self.bounds[1]))

    @cached_property
    def samples(self) -> Floats:
        """(n, 3) vertices and centroids of triangles in the lattice box."""
        used = self.vertices[np.unique(self.triangles)]
        points = np.concatenate([used, self.corners.mean(axis=1)])
        held = np.clip(points, self.box[0], self.box[1])
        return held[np.all(np.abs(held - points) <= self.slack, axis=1)]

    @property
    def spread(self) -> Floats:
        """(n, 3) those of ``SPREAD`` points spread by area over the mesh that lie in the box.

        The same on every run.
        """
        sides = self.corners[:, 1:] - self.corners[:, :1]
        area = np.cumsum(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))
        wanted = (np.arange(SPREAD) + 0.5) / SPREAD * area[-1]
        triangle = np.minimum(np.searchsorted(area, wanted), len(area) - 1)
        params = np.random.default_rng(0).random((SPREAD, 2))
        params = np.where(params.sum(axis=1, keepdims=True) > 1, 1 - params, params)
        points = self.corners[triangle, 0] + (params[:, :, None] * sides[triangle]).sum(axis=1)
        held = np.clip(points, self.box[0], self.box[1])
        return held[np.all(np.abs(held - points) <= self.slack, axis=1)]

    def slopes(self, volume: LatticeMap) -> Floats:
        """(n, 3, 3) derivatives of a map at the samples."""
        # A plan made for weights of 1 may serve other weights: then derivatives are no sums.
        if self.sums is None or volume.net_kind.rational:
            return volume.jacobian(self.samples)
        return self.sums.apply(volume.net).reshape(-1, 3, 3).transpose(0, 2, 1)

    def touching(self, low: Floats, high: Floats, among: Ints | None) -> Ints:
        """Pairs (n, 2) of a box and a triangle that meet, sorted by box; possibly a few more."""
        pairs = self._near(low, high) if among is None else among
        box, triangle = pairs[:, 0], pairs[:, 1]
        near = np.all(
            (self._low[triangle] <= high[box]) & (self._high[triangle] >= low[box]), axis=1
        )
        pairs = pairs[near]
        if len(pairs) > _CLOSELY:
            return pairs
        box, corners = pairs[:, 0], self.corners[pairs[:, 1]]
        normals, edges = triangle_directions(corners)
        grown = self._rounding
        meets = touches_boxes(corners, normals, edges, low[box] - grown, high[box] + grown)
        return pairs[meets]

    def holds(self, points: Floats) -> Bools:
        """(n,) True for points (n, 3) inside closed bodies; none of them lies on the surface."""
        if not len(points) or not self.solid.any():
            return np.zeros(len(points), dtype=bool)
        return winding_numbers(points, self.corners[self.solid]) > 0.5

    def nearest(self, pairs: Ints, points: Floats) -> Floats:
        """(n, 3) points of the pairs' triangles nearest to points (n, 3)."""
        return nearest_on_triangles(points, self.corners[pairs[:, 1]])

    @cached_property
    def _low(self) -> Floats:
        return self.corners.min(axis=1)

    @cached_property
    def _high(self) -> Floats:
        return self.corners.max(axis=1)

    @property
    def _rounding(self) -> float:
        """Length that boxes are enlarged by, so that rounding hides no triangle from them."""
        return 64 * float(np.finfo(float).eps) * float(np.abs(self.corners).max())

    def _near(self, low: Floats, high: Floats) -> Ints:
        """Pairs (n, 2) of a box and a triangle whose boxes overlap, sorted by box."""
        step = max(1, _PAIRS // len(self.corners))
        found = []
        for start in range(0, len(low), step):
            part = slice(start, start + step)
            overlap = np.ones((len(low[part]), len(self.corners)), dtype=bool)
            for axis in range(3):
                overlap &= self._low[None, :, axis] <= high[part, None, axis]
                overlap &= self._high[None, :, axis] >= low[part, None, axis]
            box, triangle = np.nonzero(overlap)
            found.append(np.column_stack([box + start, triangle]))
        return np.concatenate(found)


def place_in_box(mesh: Mesh, nesting: ShellNesting, volume: LatticeMap) -> ModelInBox:
    """The mesh, with its closed bodies marked, in the box of a map."""
    corners, polygon = triangles(mesh)
    solid = nesting.closed[nesting.body[polygon]]
    local = volume.frame.to_local(mesh.vertices)
    return ModelInBox(local, corners, solid, volume.box, mesh.delta)


def place_in_each(
    mesh: Mesh, nesting: ShellNesting, volumes: Sequence[LatticeMap]
) -> tuple[ModelInBox, ...]:
    """The mesh in the box of each of several maps."""
    return tuple(place_in_box(mesh, nesting, volume) for volume in volumes)
