"""Vertices of the B-rep, undeformed and deformed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.local_sums import LocalSums, collect_sums
from ffdcli.surface.partition import OUTSIDE, Partition
from ffdcli.volume.protocol import Restriction, Volume


@dataclass(frozen=True)
class VertexBatch:
    """Vertices in one box.

    Parameters
    ----------
    zone : int
        Index of the volume.
    vertices : (m,) int64
    places : (m, 3) float64, lattice frame
    restriction : Restriction
        Values of the volume's net at these places.
    sums : LocalSums or None
        The same as matrices; see :meth:`with_matrices`.
    """

    zone: int
    vertices: Ints
    places: Floats
    restriction: Restriction
    sums: LocalSums | None = None

    def with_matrices(self) -> VertexBatch:
        """The batch with its sums; the same batch where the volume is no tensor product."""
        restriction = self.restriction.as_tensor
        if restriction is None:
            return self
        every = np.arange(len(self.vertices))
        rows = restriction.matrices(every)[:, 0, 0, 0]
        sums = collect_sums(restriction.degrees, restriction.first, every, [(every, rows)])
        return replace(self, sums=sums)

    def images(self, volume: Volume) -> Floats:
        """(m, 3) images under a volume, model length."""
        if self.sums is None:
            values = self.restriction.apply(volume.net)[:, 0, 0, 0]
        else:
            values = self.sums.apply(volume.net)
        return volume.frame.to_model(volume.net_kind.images(values, self.places))


@dataclass(frozen=True)
class Vertices:
    """The vertices of the cut mesh that outlines keep.

    Parameters
    ----------
    used : (V,) int64
        Their numbers in the cut mesh.
    number : (n,) int64
        Index in ``used`` of each vertex of the cut mesh, -1 for none.
    rest : (V, 3) float64, model length
        Undeformed vertices; those of the mesh are bit for bit the same.
    batches : tuple of VertexBatch
        Vertices that move: those that only regions inside one box touch.
    """

    used: Ints
    number: Ints
    rest: Floats
    batches: tuple[VertexBatch, ...]

    def with_matrices(self) -> Vertices:
        """The vertices with the sums of all batches."""
        return replace(self, batches=tuple(batch.with_matrices() for batch in self.batches))

    def deformed(self, volumes: Sequence[Volume]) -> Floats:
        """(V, 3) images; vertices that do not move are bit for bit the same."""
        points = self.rest.copy()
        for batch in self.batches:
            points[batch.vertices] = batch.images(volumes[batch.zone])
        return points


def plan_vertices(edges: Ints, parts: Partition, model_vertices: Floats) -> Vertices:
    """Find the vertices of edges (E, 2), and the lattice box that each of them moves with.

    Parameters
    ----------
    edges : (E, 2) int64
        Vertices of the cut mesh.
    parts : Partition
    model_vertices : (n, 3) float64, model length
        Vertices of the mesh, which come first in the cut mesh.
    """
    volumes = parts.facets.volumes
    used = np.unique(edges)
    number = np.full(len(parts.pieces.vertices), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    rest = volumes[0].frame.to_model(parts.pieces.vertices[used, 0])
    original = used < len(model_vertices)
    rest[original] = model_vertices[used[original]]
    # Vertices on the seam with the part outside belong to the outside, where the deformation is the
    # identity; vertices on the common side of two boxes belong to neither, for the same reason.
    zone = parts.zone[parts.patch[parts.region]][parts.pieces.owner]
    lowest = np.full(len(parts.pieces.vertices), len(volumes))
    highest = np.full(len(parts.pieces.vertices), OUTSIDE)
    np.minimum.at(lowest, parts.pieces.corners, zone)
    np.maximum.at(highest, parts.pieces.corners, zone)
    home = np.where(lowest == highest, highest, OUTSIDE)[used]
    batches = []
    for zone_number, volume in enumerate(volumes):
        moved = np.flatnonzero(home == zone_number)
        if len(moved):
            at = parts.pieces.vertices[used[moved], zone_number]
            values = volume.at_points(volume.cells(at), at)
            batches.append(VertexBatch(zone_number, moved, at, values))
    return Vertices(used, number, rest, tuple(batches))
