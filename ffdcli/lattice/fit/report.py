"""What a fit reached: residuals, noise, outliers, and the lattice that it took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.fit.scan_report import ScanReport

# Largest number of outliers that a report lists.
_LISTED = 100
# Largest number of outliers that a warning names.
_NAMED = 8
_WHY = {
    "noise": "; smaller cells predict the pairs no better: the rest is noise",
    "max_depth": "; cells are as small as `max_depth` allows",
    "max_points": "; there are as many control points as `max_points` allows",
}


@dataclass(frozen=True, eq=False)
class FitReport:
    """What a fit reached, in model coordinates.

    Parameters
    ----------
    numbers : (m,) int64
        Numbers of the pairs that were used, from 0 in the order of the file. Reports and messages
        count from 1.
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
    notes : tuple of str
        Sentences on the pairs themselves.
    scan : ScanReport or None
        Of a fit onto a scan, whose pairs are those that the registration found.
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
    notes: tuple[str, ...] = ()
    scan: ScanReport | None = None

    @property
    def distances(self) -> Floats:
        """(m,) distance of each image from its target."""
        return np.asarray(np.linalg.norm(self.left, axis=1))

    @property
    def control_points(self) -> int:
        """Number of control points that moved freely."""
        return sum(self.levels)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on pairs that were left out, disagree, or are missed."""
        apart, found = self.distances, []
        if len(self.outside):
            count = _pairs(len(self.outside))
            where = f"lie{'s' * (len(self.outside) == 1)} outside the lattice box"
            found.append(f"{count} {where}, such as pair {self.outside[0] + 1}: left out")
        if self.outlier.any():
            which = np.flatnonzero(self.outlier)
            which = which[np.argsort(-apart[which], kind="stable")]
            named = [f"pair {self.numbers[q] + 1} by {apart[q]:.3g}" for q in which[:_NAMED]]
            more = f", and {len(which) - _NAMED} more" if len(which) > _NAMED else ""
            verb = (
                "disagrees with those around and counts"
                if len(which) == 1
                else ("disagree with those around and count")
            )
            text = f"{_pairs(len(which))} {verb} less or nothing: "
            found.append(f"{text}{', '.join(named)}{more} (with `robust: false` all count in full)")
        missed = (apart > self.tolerance) & ~self.outlier
        if missed.any():
            worst = int(np.argmax(np.where(missed, apart, 0.0)))
            place = ", ".join(f"{value:.6g}" for value in self.sources[worst])
            rms = float(np.sqrt(np.mean(apart[~self.outlier] ** 2)))
            text = f"{missed.sum():,} of {_pairs(len(apart))} are missed by more than "
            text += f"{self.tolerance:.3g}: rms {rms:.3g}, the largest {apart[worst]:.3g} for pair "
            text += f"{self.numbers[worst] + 1} at ({place})"
            found.append(text + _WHY.get(self.stopped or "", ""))
        return (*found, *self.notes)

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
            "largest_pair": int(self.numbers[worst]) + 1 if len(kept) else None,
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
                {"pair": int(self.numbers[q]) + 1, "distance": float(distances[q])}
                for q in which[:_LISTED]
            ],
            **({} if self.scan is None else {"scan": self.scan.as_report()}),
        }


def facts_of_fits(fits: Sequence[FitReport]) -> dict[str, Any]:
    """The section `fits` of reports; none where nothing was fitted."""
    return {"fits": [fit.as_report() for fit in fits]} if fits else {}


def _pairs(count: int) -> str:
    return f"{count:,} pair{'s' * (count != 1)}"
