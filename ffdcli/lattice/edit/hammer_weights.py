"""Hammer by weights: another height of a peak with no control point moved."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.drag.reweigh import FLOOR
from ffdcli.lattice.edit.peak import Peak
from ffdcli.lattice.edit.site import EditSite

# Least and largest factor of a weight.
LIMITS = FLOOR, 1 / FLOOR
# Ways from the point on which profiles are compared, places on each, and pairs of weights tried.
_WAYS, _STEPS, _TRIED = 8, 24, 33
# Relative difference up to which displacements count as equal.
_EQUAL = 1e-9


@dataclass(frozen=True)
class _Profile:
    """Heights of a peak at places, as functions of the factors of three sets of weights.

    Parameters
    ----------
    heights : (m,) float64
        Heights now; the first place is the point.
    sums : (3, m) float64
        For each set, sums of ``w N (P - Q)`` along the peak, where Q is the image now.
    masses : (3, m) float64
        For each set, sums of ``w N``.
    """

    heights: Floats
    sums: Floats
    masses: Floats

    def under(self, factors: tuple[float, float]) -> Floats:
        """Heights (m,) with factors of the first two sets; the third keeps its weights."""
        all_factors = np.array([*factors, 1.0])
        return np.asarray(self.heights + (all_factors @ self.sums) / (all_factors @ self.masses))

    def factors(self, height: float) -> tuple[float, float] | None:
        """Factors that give the point this height, and change the profile least.

        None if there are none within the limits.
        """
        first, second, third = self.sums[:, 0] - (height - self.heights[0]) * self.masses[:, 0]
        if first == 0:
            return None
        # The first factor is slope * second factor + offset.
        slope, offset = -second / first, -third / first
        low, high = LIMITS
        if slope != 0:
            ends = sorted((limit - offset) / slope for limit in LIMITS)
            low, high = max(low, ends[0]), min(high, ends[1])
        elif not low <= offset <= high:
            return None
        if not low <= high:
            return None

        def change(logarithm: float) -> float:
            factor = float(np.exp(logarithm))
            after = self.under((slope * factor + offset, factor))
            return float(np.square(after * self.heights[0] - self.heights * height).sum())

        tried = np.linspace(np.log(low), np.log(high), _TRIED)
        best = int(np.argmin([change(each) for each in tried]))
        around = tried[max(best - 1, 0)], tried[min(best + 1, _TRIED - 1)]
        chosen = float(np.exp(minimize_scalar(change, bounds=around, method="bounded").x))
        return slope * chosen + offset, chosen


def hammered_weights(lattice: BoxLattice, peak: Peak, height: float, site: EditSite) -> Floats:
    """Weights that give a peak another height (Song & Yang 2005, section 6).

    Two factors: one for the control points that reach the point and are displaced by more than the
    wanted height, one for the others that reach it. Their ratio makes the height, since a point
    moves towards control points that get heavier. What the others weigh against the control points
    around them makes the width: it is chosen so that the profile changes least.

    Raises
    ------
    LatticeError
        No weights within a hundredth and a hundred times those now give the height.
    """
    free = (peak.functions > 0) & lattice.free
    moves = (lattice.points - lattice.control.at_rest.rest_points) @ peak.along
    lowest, highest = moves[free].min(), moves[free].max()
    room = _EQUAL * max(abs(lowest), abs(highest))
    # Neither set is empty, so that the error can name what is reached.
    raised = free & (moves > np.clip(height, lowest + room, highest - room))
    sets = np.stack([raised, free & ~raised, ~free])
    profile = _profile(lattice, peak, sets)
    factors = profile.factors(height)
    if factors is None:
        reached = [profile.under((a, b))[0] for a, b in product(LIMITS, LIMITS)]
        message = (
            f"weights alone make this peak from {min(reached):.6g} to {max(reached):.6g} high, "
            f"not {height:g}"
        )
        hint = "leave out `by: weights`, or move the control points of the peak further first"
        raise site.source.error(("height",), message, hint)
    return np.asarray(lattice.weights * np.select(list(sets[:2]), factors, 1.0))


def _profile(lattice: BoxLattice, peak: Peak, sets: Bools) -> _Profile:
    """The profile at the point and on ways from it across the peak, as far as it reaches."""
    rest, weights = lattice.control.at_rest, lattice.weights
    arms = rest.rest_points[peak.functions > 0] - peak.place
    far = 2 * np.linalg.norm(arms, axis=-1).max()
    across = np.linalg.svd(peak.along[None])[2][1:]
    turn = 2 * np.pi * np.arange(_WAYS) / _WAYS
    ways = np.stack([np.cos(turn), np.sin(turn)], axis=1) @ across
    steps = far * np.arange(1, _STEPS + 1) / _STEPS
    places = peak.place + (steps[:, None, None] * ways).reshape(-1, 3)
    places = places[rest.contains(places)]
    places = np.concatenate([peak.place[None], places[rest.has_parameters(places)]])
    heights = (lattice.map.evaluate(places) - places) @ peak.along
    basis = rest.basis_matrix(places)
    along = lattice.points.reshape(-1, 3) @ peak.along
    share = weights.ravel() * sets.reshape(3, -1)
    masses = (basis @ share.T).T
    sums = (basis @ (share * along).T).T
    image = sums.sum(axis=0) / masses.sum(axis=0)
    return _Profile(heights, sums - masses * image, masses)
