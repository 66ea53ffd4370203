"""Polygons of a mesh file before any check, and the precision of their coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.record import Mesh

# A last printed digit coarser than this share of the size is a choice of style (0, 1, 0.5), not a
# limit of precision: such coordinates count as exact.
COARSEST_DIGIT = 1e-5


@dataclass(frozen=True)
class RawMesh(Mesh):
    """Polygons as stored in a file: not checked, not welded, unused vertices kept.

    Corners may refer to vertices that do not exist, and texture coordinates need not be finite.

    Parameters
    ----------
    part : (V,) int64 or None
        Part of the file that each vertex belongs to; None for a file with one part.
    """

    part: Ints | None = None


def binary_resolution(vertices: Floats, kind: type[np.floating[Any]]) -> float:
    """Four units in the last place of a float type at the largest coordinate."""
    largest = np.abs(vertices[np.isfinite(vertices)]).max(initial=0.0)
    return 4 * float(np.spacing(kind(largest)))


def text_resolution(vertices: Floats, decimals: int, stretch: float = 1.0) -> float:
    """Half the last printed digit, if finer than `COARSEST_DIGIT`; at least four double ulps.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
    decimals : int
        Most decimals printed for any coordinate.
    stretch : float
        Largest factor by which transforms lengthen the printed coordinates.
    """
    exact = binary_resolution(vertices, np.float64)
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    if not len(finite):
        return exact
    half_digit = 0.5 * 10.0**-decimals * stretch
    size = float(np.linalg.norm(np.ptp(finite, axis=0)))
    return max(exact, half_digit) if half_digit <= COARSEST_DIGIT * size else exact
