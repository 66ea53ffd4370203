"""The tolerances of one run: few, named, made once and passed on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints

# What CAD kernels can hold: an absolute floor, and units in the last place of a coordinate.
_KERNEL_TOLERANCE = 1e-7
_KERNEL_ULPS = 64.0
# Edges shorter than this many tolerances are merged by kernels that read the file.
_SHORT_EDGE = 2.0
# Share of the size by which surfaces may change where a vertex counts as lying on a plane.
_UNSEEN = 1e-13


@dataclass(frozen=True)
class Tolerances:
    """Lengths that decide what coincides.

    Parameters
    ----------
    size : float, model length
        Diagonal of the undeformed bounding box.
    epsilon : float, model length
        The larger of delta and the deviation from planes that it led to: what is straight, flat,
        and without slope (docs/design.md, "Tolerances").
    kernel : float, model length
        Tolerance that CAD kernels need for the undeformed model.
    """

    size: float
    epsilon: float
    kernel: float

    def reach(self, continuity: Ints) -> Floats:
        """Distances within which it makes no difference on which side of a plane a point lies.

        Across a plane where the volume is C^c the two polynomials part with the power c + 1 of the
        distance. Below ``reach`` that is less than rounding, or than a tenth of epsilon where the
        mesh itself is no better.
        """
        # Epsilon is a billionth of the size for sound meshes; only noise beyond that counts.
        noise = 0.1 * self.epsilon / self.size if self.epsilon > 2e-9 * self.size else 0.0
        share = max(_UNSEEN, noise)
        order = np.minimum(np.asarray(continuity) + 1, 3)
        return np.asarray(self.size * share ** (1.0 / order))

    def snap(self, continuity: Ints) -> Floats:
        """Distances within which a vertex lies on a plane across which the volume is C^c.

        At least epsilon; up to twice the shortest edge that kernels keep, so that cuts leave none
        shorter, as far as ``reach`` allows.
        """
        wanted = np.minimum(self.reach(continuity), 2 * self.shortest_edge)
        return np.asarray(np.maximum(self.epsilon, wanted))

    @property
    def shortest_edge(self) -> float:
        """Length of edges that kernels do not merge."""
        return _SHORT_EDGE * max(self.kernel, self.epsilon)


def kernel_tolerance(points: Floats) -> float:
    """Tolerance that CAD kernels need for model coordinates (..., 3)."""
    return max(_KERNEL_TOLERANCE, kernel_rounding(points))


def kernel_rounding(points: Floats) -> float:
    """What rounding may add to a distance that a kernel finds between model points (..., 3)."""
    largest = float(np.abs(points).max(initial=0.0))
    return _KERNEL_ULPS * float(np.finfo(float).eps) * largest
