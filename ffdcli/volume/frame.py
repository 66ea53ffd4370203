"""The lattice frame: an orthonormal frame in which a point's coordinates are its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ffdcli.arrays import Floats


@dataclass(frozen=True)
class Frame:
    """Origin and unit axes of the parameters ``(u, v, w)``.

    Parameters
    ----------
    origin : (3,) float64, model length
    axes : (3, 3) float64
        Rows are the unit vectors of u, v and w.
    """

    origin: Floats
    axes: Floats

    @cached_property
    def aligned(self) -> bool:
        """True where the axes are the model's, so that rotation rounds no coordinate."""
        return bool(np.array_equal(self.axes, np.eye(3)))

    def same(self, other: Frame) -> bool:
        """True where origin and axes are equal."""
        return np.array_equal(self.origin, other.origin) and np.array_equal(self.axes, other.axes)

    def to_local(self, points: Floats) -> Floats:
        """Parameters (..., 3) of model points (..., 3)."""
        shifted = points - self.origin
        return shifted if self.aligned else shifted @ self.axes.T

    def to_model(self, points: Floats) -> Floats:
        """Model points (..., 3) of parameters (..., 3)."""
        turned = points if self.aligned else points @ self.axes
        return turned + self.origin

    def turn_to_model(self, vectors: Floats) -> Floats:
        """Model components (..., 3) of vectors (..., 3) given in the frame."""
        return vectors if self.aligned else vectors @ self.axes


def aligned_frame(low: Floats, high: Floats) -> Frame:
    """Frame of an axis-aligned box with corners (3,), (3,), without loss of digits.

    The origin is zero unless the box lies far from it. Then it is the centre of the box, rounded to
    a grid so coarse that ``point - origin`` is exact for every point near the box. All digits then
    serve the extent of the box, none the offset.
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    extent = float((high - low).max())
    centre = (low + high) / 2
    if extent <= 0:
        return Frame(np.zeros(3), np.eye(3))
    grid = 2.0 ** np.ceil(np.log2(extent) + 1)
    far = np.abs(centre) > 2 * grid
    origin = np.where(far, np.floor(centre / grid) * grid, 0.0)
    return Frame(origin, np.eye(3))
