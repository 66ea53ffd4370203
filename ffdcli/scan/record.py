"""Scans as files give them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Scan:
    """A scanned surface: points, with triangles or without.

    Parameters
    ----------
    points : (n, 3) float64, scan's length unit
    triangles : (t, 3) int64
        Points of each triangle; no rows for a point cloud.
    normals : (n, 3) float64 or None
        Normals that the file of a point cloud gives, of any length.
    notes : tuple of str
        What a reader of the file should know, one sentence each.
    """

    points: Floats
    triangles: Ints
    normals: Floats | None = None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> float:
        """Diagonal of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def scaled(self, factor: float) -> Scan:
        """The scan in another length unit."""
        return self if factor == 1 else replace(self, points=self.points * factor)
