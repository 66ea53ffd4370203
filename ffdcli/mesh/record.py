"""The polygon mesh: one frozen record of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
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
        What the file's number format can tell apart: four units in the last place of the stored
        precision at the largest coordinate; for text, half the last printed digit.
    unit : str or None
        Length unit stated by the file.
    source : str
        File name, for messages.
    notes : tuple of str
        What reading and repair did: one plain sentence each, for the report's warnings.
    groups : mapping of str to (n,) int64
        Polygons of each named group, object or part that the file tells apart.
    labels : Labels or None
        Bodies, groups and materials by the file's names; None where it names none.
    uv : (C, 2) float64 or None
        Texture coordinates of every polygon corner, v upwards as in OBJ; NaN at all corners of the
        polygons that have none, None where none has any.
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
        """(2, 3) lowest and highest coordinates of the vertices that polygons use."""
        used = self.vertices[self.corners]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, model length; tolerances are shares of it."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def delta(self) -> float:
        """Distance within which points count as coplanar, model length (design, section 4)."""
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
        """The mesh with other polygons, which keep what the file says of those they come from.

        Parameters
        ----------
        vertices, corners, starts
            As in the record.
        origin : (P',) int64
            For each new polygon the old one that it is, or is part of.
        corner : (C',) int64
            For each new corner the old one that it is, or whose texture coordinates it takes.
        notes : tuple of str
            What was done, added to the notes.
        """
        groups = {
            name: np.flatnonzero(np.isin(origin, members)) for name, members in self.groups.items()
        }
        return replace(
            self,
            vertices=vertices,
            corners=corners,
            starts=starts,
            notes=(*self.notes, *notes),
            groups=groups,
            labels=self.labels and self.labels.take(origin),
            uv=None if self.uv is None else self.uv[corner],
        )

    def without(self, chosen: NDArray[np.bool_]) -> Mesh:
        """The mesh without the chosen polygons (P,)."""
        kept = np.flatnonzero(~chosen)
        counts = np.diff(self.starts)[kept]
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        left = np.flatnonzero(~chosen[self.polygon_of_corner])
        return self.rebuilt(self.vertices, self.corners[left], starts, kept, left)

    @cached_property
    def polygon_of_corner(self) -> Ints:
        """(C,) polygon of each corner."""
        return np.repeat(np.arange(self.polygon_count), np.diff(self.starts))
