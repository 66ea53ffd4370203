"""The polygon mesh: one frozen record of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, gather_runs, run_numbers, run_starts
from ffdcli.labels import Labels


@dataclass(frozen=True)
class Mesh:
    """A polygon mesh, as read.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
    corners : (C,) int64
        Vertex of every polygon corner, polygon after polygon, counter-clockwise seen from outside.
    starts : (P + 1,) int64
        Polygon ``p`` has corners ``corners[starts[p]:starts[p + 1]]``.
    resolution : float, model length
        Smallest distance that the number format of the file resolves: four units in the last place
        of the stored precision at the largest coordinate; for text, half the last printed digit.
    unit : str or None
        Length unit stated by the file.
    source : str
        File name, for messages.
    notes : tuple of str
        What reading and repair changed, one sentence each, for the warnings of reports.
    groups : mapping of str to (n,) int64
        Polygons of each named group, object or part of the file.
    labels : Labels or None
        Bodies, groups and materials as the file names them; None if it names none.
    uv : (C, 2) float64 or None
        Texture coordinates of every polygon corner, v upwards as in OBJ; NaN at all corners of a
        polygon without them, None if no polygon has any.
    """

    vertices: Floats
    corners: Ints
    starts: Ints
    resolution: float = 0.0
    unit: str | None = None
    source: str = "mesh"
    notes: tuple[str, ...] = ()
    groups: Mapping[str, Ints] = field(default_factory=dict)
    labels: Labels | None = None
    uv: Floats | None = None

    @property
    def polygon_count(self) -> int:
        """Number of polygons."""
        return len(self.starts) - 1

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest coordinates of the vertices used by polygons."""
        used = self.vertices[self.corners]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, model length; tolerances are shares of it."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def delta(self) -> float:
        """Coplanarity distance δ, model length (docs/design.md, "Tolerances")."""
        return max(1e-9 * self.size, self.resolution)

    def rebuilt(
        self,
        vertices: Floats,
        corners: Ints,
        starts: Ints,
        origin: Ints,
        corner: Ints,
        notes: tuple[str, ...] = (),
    ) -> Mesh:
        """The mesh with other polygons, which inherit groups, labels and texture coordinates.

        Parameters
        ----------
        origin : (P',) int64
            Old polygon that each new one is, or is part of.
        corner : (C',) int64
            Old corner that each new one is, or whose texture coordinates it takes.
        """
        return replace(
            self,
            vertices=vertices,
            corners=corners,
            starts=starts,
            notes=(*self.notes, *notes),
            groups=self._groups_of(origin),
            labels=self.labels and self.labels.take(origin),
            uv=None if self.uv is None else self.uv[corner],
        )

    def _groups_of(self, origin: Ints) -> dict[str, Ints]:
        """Groups of polygons made from old ones (P',), all at once: there can be many."""
        members = list(self.groups.values())
        flat = np.concatenate([np.zeros(0, dtype=np.int64), *members])
        group = np.repeat(np.arange(len(members)), [len(each) for each in members])
        runs = run_starts(np.bincount(flat, minlength=self.polygon_count))
        starts, index = gather_runs(runs, origin)
        found = group[np.argsort(flat, kind="stable")][index]
        polygons = run_numbers(starts)[np.argsort(found, kind="stable")]
        ends = np.cumsum(np.bincount(found, minlength=len(members)))
        return dict(zip(self.groups, np.split(polygons, ends[:-1]), strict=False))

    def without(self, chosen: Bools) -> Mesh:
        """The mesh without the chosen polygons (P,)."""
        return self.with_corners(~chosen[self.polygon_of_corner])

    def with_corners(self, kept: Bools) -> Mesh:
        """The mesh with the kept corners (C,); polygons left with fewer than three are dropped."""
        counts = np.bincount(self.polygon_of_corner[kept], minlength=self.polygon_count)
        corner = np.flatnonzero(kept & (counts > 2)[self.polygon_of_corner])
        polygon = np.flatnonzero(counts > 2)
        starts = run_starts(counts[polygon])
        return self.rebuilt(self.vertices, self.corners[corner], starts, polygon, corner)

    @cached_property
    def polygon_of_corner(self) -> Ints:
        """(C,) polygon of each corner."""
        return run_numbers(self.starts)

    def loop(self, polygon: int) -> Ints:
        """(n,) vertices of a polygon, in its order."""
        return self.corners[self.starts[polygon] : self.starts[polygon + 1]]

    def middle(self, polygon: int) -> Floats:
        """(3,) mean of a polygon's corners, model length."""
        return np.asarray(self.vertices[self.loop(polygon)].mean(axis=0))
