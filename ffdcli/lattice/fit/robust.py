"""Pairs that disagree with all their neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Floats, Ints

# Neighbours of a pair, and pairs from which on neighbours tell anything.
_NEAR = 12
FEWEST = 100
# Disagreement, in medians of those around, up to which a pair counts in full, and from which on it
# does not count. With normal noise six standard deviations are four medians.
_FULL = 3.0
_NOTHING = 4.5


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The nearest pairs of each pair.

    Parameters
    ----------
    near : (m, 12) int64
    floor : float
        Disagreement that always counts in full.
    """

    near: Ints
    floor: float

    @staticmethod
    def of(places: Floats, floor: float) -> Neighbours:
        """The neighbours among places (m, 3), of which there are at least :data:`FEWEST`."""
        near = cKDTree(places).query(places, k=_NEAR + 1)[1]
        own = near == np.arange(len(places))[:, None]
        # With many pairs in one place a pair may not be among its own nearest.
        own[~own.any(axis=1), -1] = True
        return Neighbours(near[~own].reshape(len(places), _NEAR), floor)

    def disagreement(self, left: Floats) -> Floats:
        """(m,) distance of each residual (m, 3) from the median of those around it."""
        return np.asarray(np.linalg.norm(left - np.median(left[self.near], axis=1), axis=1))

    def factors(self, left: Floats) -> Floats:
        """(m,) weights from 0 to 1 for residuals (m, 3).

        A pair is measured by its disagreement with its neighbours, in medians of the disagreement
        of all and of the neighbours: where the functions cannot follow the field, neighbours
        disagree as well, and nothing is an outlier. Up to some size the weight is 1 (Hampel 1974),
        so that clean data has no outliers.
        """
        apart = self.disagreement(left)
        around = np.median(apart[self.near], axis=1)
        unit = np.maximum(np.maximum(around, np.median(apart)), self.floor / _FULL)
        size = apart / np.maximum(unit, 1e-300)
        return np.asarray(((_NOTHING - size) / (_NOTHING - _FULL)).clip(0.0, 1.0))
