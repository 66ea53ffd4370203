"""Polygons of a mesh file before any check, and the precision of their coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.labels import Labels

# A last printed digit coarser than this share of the size is a choice of style (0, 1, 0.5), not a
# limit of precision: such coordinates count as exact.
COARSEST_DIGIT = 1e-5


@dataclass(frozen=True)
class RawMesh:
    """Polygons as stored in a file: not checked, not welded, unused vertices kept.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
    corners, starts : (C,) and (P + 1,) int64
        As in `Mesh`; corners may refer to vertices that do not exist.
    resolution : float, model length
        As in `Mesh`.
    unit : str or None
        Length unit stated by the file.
    notes : tuple of str
        What the decoder left out or changed.
    groups : mapping of str to (n,) int64
        Polygons of each named group, object or part.
    labels : Labels or None
    uv : (C, 2) float64 or None
        Texture coordinates of the corners; not finite where a corner has none.
    part : (V,) int64 or None
        Part of the file that each vertex belongs to; None for a file with one part.
    """

    vertices: Floats
    corners: Ints
    starts: Ints
    resolution: float
    unit: str | None = None
    notes: tuple[str, ...] = ()
    groups: Mapping[str, Ints] = field(default_factory=dict)
    labels: Labels | None = None
    uv: Floats | None = None
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
    if not len(vertices) or not np.isfinite(vertices).all():
        return exact
    half_digit = 0.5 * 10.0**-decimals * stretch
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return max(exact, half_digit) if half_digit <= COARSEST_DIGIT * size else exact
