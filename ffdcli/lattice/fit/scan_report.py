"""How near a fitted model and a scan are to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats

# Share of a model, or of the points of a scan, of which no warning speaks.
_WHOLE = 0.98


@dataclass(frozen=True, eq=False)
class ScanReport:
    """Distances both ways between a deformed model and a scan, in model coordinates.

    Parameters
    ----------
    points : (n, 3) float64
        Points of the scan that were compared.
    distances : (n,) float64
        Their distance from the deformed model.
    used : (n,) bool
        Those that count as scanned from the model.
    places : (k, 3) float64
        Points of the deformed model, each for the same area.
    gaps : (k,) float64
        Their distance from the scan; NaN at edges of a point cloud.
    covered : (k,) bool
        Those that the scan reaches.
    reach : float
        Largest distance at which a point of the scan counts.
    tolerance : float
    rounds : int
        How often the nearest places were looked for.
    smooth : float or None
        Weight of the bending energy that points left out chose; None where the fit chose it.
    """

    points: Floats
    distances: Floats
    used: Bools
    places: Floats
    gaps: Floats
    covered: Bools
    reach: float
    tolerance: float
    rounds: int
    smooth: float | None

    @property
    def coverage(self) -> float:
        """Share of the deformed model that the scan reaches."""
        return float(np.mean(self.covered))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on a scan of a part of the model, and on points of something else."""
        found = []
        if self.coverage < _WHOLE:
            text = f"the scan covers {self.coverage:.0%} of the model"
            found.append(f"{text}: elsewhere the lattice continues what it does there")
        unused = int(np.count_nonzero(~self.used))
        if unused > (1 - _WHOLE) * len(self.used):
            found.append(
                f"{unused:,} of {len(self.used):,} points of the scan do not count: they are more "
                f"than {self.reach:.3g} from the model, face another way, or disagree with those "
                "around"
            )
        return tuple(found)

    def as_report(self) -> dict[str, Any]:
        """The figures of the report."""
        measured = self.covered & np.isfinite(self.gaps)
        return {
            "points": len(self.points),
            "used": int(self.used.sum()),
            "reach": self.reach,
            "rounds": self.rounds,
            "coverage": self.coverage,
            "within_tolerance": float(np.mean(self.distances <= self.tolerance)),
            "scan_to_model": _figures(self.points[self.used], self.distances[self.used]),
            "model_to_scan": _figures(self.places[measured], self.gaps[measured]),
        }


def _figures(points: Floats, distances: Floats) -> dict[str, Any]:
    if not len(points):
        return {"rms": None, "largest": None, "largest_at": None}
    worst = int(distances.argmax())
    return {
        "rms": float(np.sqrt(np.mean(distances**2))),
        "largest": float(distances[worst]),
        "largest_at": points[worst].tolist(),
    }
