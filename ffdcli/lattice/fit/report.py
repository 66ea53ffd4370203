"""What a fit reached: residuals, noise, outliers, and the lattice that it took."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints

# Largest number of outliers that a report lists.
_LISTED = 100


@dataclass(frozen=True, eq=False)
class FitReport:
    """What a fit reached, in model coordinates.

    Parameters
    ----------
    numbers : (m,) int64
        Numbers of the pairs that were used, from 0 in the order of the file.
    sources : (m, 3) float64
        Their points of the undeformed object.
    left : (m, 3) float64
        Residual of each: what its image lacks to the target.
    outlier : (m,) bool
        Pairs that disagree with all their neighbours, and count less or not at all.
    outside : (q,) int64
        Numbers of the pairs that lie outside the lattice box, and were left out.
    tolerance : float
        Distance within which a target counts as met.
    noise : float
        Root mean square of the noise of the targets, estimated; 0 where there is none to see.
    smooth : float
        Weight of the bending energy.
    levels : tuple of int
        Control points that moved freely, on each level from the coarsest.
    stopped : str or None
        Why an octree that the fit divides was divided no further: `tolerance`, `noise`, `max_depth`
        or `max_points`.
    """

    numbers: Ints
    sources: Floats
    left: Floats
    outlier: Bools
    outside: Ints
    tolerance: float
    noise: float
    smooth: float
    levels: tuple[int, ...]
    stopped: str | None = None

    @property
    def distances(self) -> Floats:
        """(m,) distance of each image from its target."""
        return np.asarray(np.linalg.norm(self.left, axis=1))

    @property
    def control_points(self) -> int:
        """Number of control points that moved freely."""
        return sum(self.levels)

    def as_report(self) -> dict[str, Any]:
        """The figures of the report, without outliers in the residual."""
        distances = self.distances
        kept = distances[~self.outlier]
        worst = int(np.argmax(np.where(self.outlier, -1.0, distances))) if len(kept) else 0
        which = np.flatnonzero(self.outlier)
        which = which[np.argsort(-distances[which], kind="stable")]
        return {
            "pairs": len(distances),
            "outside": len(self.outside),
            "rms": float(np.sqrt(np.mean(kept**2))) if len(kept) else 0.0,
            "largest": float(kept.max(initial=0.0)),
            "largest_pair": int(self.numbers[worst]) if len(kept) else None,
            "largest_at": self.sources[worst].tolist() if len(kept) else None,
            "tolerance": self.tolerance,
            "within_tolerance": float(np.mean(distances <= self.tolerance)),
            "noise": self.noise,
            "smooth": self.smooth,
            "stopped": self.stopped,
            "levels": list(self.levels),
            "control_points": self.control_points,
            "outliers": len(which),
            "outliers_listed": [
                {"pair": int(self.numbers[q]), "distance": float(distances[q])}
                for q in which[:_LISTED]
            ],
        }
