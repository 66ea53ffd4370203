"""The tolerances of a run, and those that CAD kernels need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints

# Tolerance of CAD kernels: an absolute minimum, and units in the last place of a coordinate.
_KERNEL_TOLERANCE = 1e-7
_KERNEL_ULPS = 64.0
# CAD kernels that read the file merge edges shorter than this many tolerances.
_SHORT_EDGE = 2.0
# Share of the size by which surfaces may change when a vertex counts as lying on a plane.
_UNSEEN = 1e-13


@dataclass(frozen=True)
class Tolerances:
    """Lengths below which points, lines and planes coincide.

    Parameters
    ----------
    size : float, model length
        Diagonal of the undeformed bounding box.
    epsilon : float, model length
        The larger of delta and the deviation of vertices from their planes: lines within epsilon
        are straight, planes parallel to an axis within epsilon have no slope along it
        (docs/design.md, "Tolerances").
    kernel : float, model length
        Tolerance that CAD kernels need for the undeformed model.
    """

    size: float
    epsilon: float
    kernel: float

    def reach(self, continuity: Ints) -> Floats:
        """Distances from a plane within which the polynomials of both sides agree.

        Across a plane where the volume is C^c they differ by the power c + 1 of the distance. Below
        ``reach`` that is less than rounding, or less than a tenth of epsilon where the mesh itself
        is not more accurate.
        """
        # Epsilon is 1e-9 of the size for sound meshes; only noise beyond that counts.
        noise = 0.1 * self.epsilon / self.size if self.epsilon > 2e-9 * self.size else 0.0
        share = max(_UNSEEN, noise)
        order = np.minimum(np.asarray(continuity) + 1, 3)
        return np.asarray(self.size * share ** (1.0 / order))

    def snap(self, continuity: Ints) -> Floats:
        """Distances within which a vertex lies on a plane across which the volume is C^c.

        At least epsilon, and up to twice the shortest edge that kernels keep as far as ``reach``
        allows, so that cuts leave no shorter edges.
        """
        wanted = np.minimum(self.reach(continuity), 2 * self.shortest_edge)
        return np.asarray(np.maximum(self.epsilon, wanted))

    @property
    def shortest_edge(self) -> float:
        """Length of the shortest edges that kernels do not merge."""
        return _SHORT_EDGE * max(self.kernel, self.epsilon)


def kernel_tolerance(points: Floats) -> float:
    """Tolerance that CAD kernels need for model coordinates (..., 3)."""
    return max(_KERNEL_TOLERANCE, kernel_rounding(points))


def kernel_rounding(points: Floats) -> float:
    """Rounding error of distances that kernels measure between model points (..., 3)."""
    largest = float(np.abs(points).max(initial=0.0))
    return _KERNEL_ULPS * float(np.finfo(float).eps) * largest
