"""Pairs that disagree with all their neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints

# Neighbours of a pair, and pairs from which on neighbours tell anything.
_NEAR = 12
FEWEST = 100
# Disagreement, in upper quartiles of those around, up to which a pair counts in full, and from
# which on it does not count. With normal noise six standard deviations are three quartiles. At the
# rim of the pairs, where fits go astray, it takes more: by this factor of how far out a pair is.
_FULL = 3.5
_NOTHING = 5.5
_RIM = 2.0
# A neighbour supports a pair if it deviates the same way by this share. Three make it no outlier.
_SHARE = 0.2
_SUPPORT = 3
_SAME_WAY = 0.7
# Least share of a residual that the pair itself does not determine.
_LEAST_FREE = 0.05


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The nearest pairs of each pair.

    Parameters
    ----------
    near : (m, 12) int64
    rim : (m,) float64
        Distance of each pair from the mean of its neighbours, over their root mean square distance.
    floor : float
        Disagreement, and distance from the target, up to which pairs count in full in any case.
    """

    near: Ints
    rim: Floats
    floor: float

    @staticmethod
    def of(places: Floats, floor: float) -> Neighbours:
        """The neighbours among places (m, 3), of which there are at least :data:`FEWEST`."""
        near = cKDTree(places).query(places, k=_NEAR + 1)[1]
        own = near == np.arange(len(places))[:, None]
        # With many pairs in one place a pair may not be among its own nearest.
        own[~own.any(axis=1), -1] = True
        near = near[~own].reshape(len(places), _NEAR)
        arms = places[near] - places[:, None]
        spread = np.sqrt((arms**2).sum(axis=2).mean(axis=1))
        out = np.linalg.norm(arms.mean(axis=1), axis=1) / np.maximum(spread, 1e-300)
        return Neighbours(near, out, floor)

    def disagreement(self, left: Floats) -> Floats:
        """(m,) distance of each residual (m, 3) from the median of those around it."""
        return np.asarray(np.linalg.norm(left - np.median(left[self.near], axis=1), axis=1))

    def factors(self, left: Floats, before: Floats, leverage: Floats) -> Floats:
        """(m,) weights from 0 to 1.

        A pair is measured by the disagreement of its error with those of its neighbours, if each
        were predicted from all others. The unit is what is usual among the neighbours: where the
        functions cannot follow the field, they disagree as well, and nothing is an outlier. Up to
        some size the weight is 1 (Hampel 1974), so that clean data has no outliers; neighbours
        that deviate the same way, as in a dent, support each other.

        Parameters
        ----------
        left : (m, 3) float64
            Residuals.
        before : (m,) float64
            Weights from 0 to 1 with which these came out.
        leverage : (m,) float64
            Estimates of the share of each pair in its own image.
        """
        usual = (leverage + leverage[self.near].sum(axis=1)) / (1 + _NEAR)
        free = np.where(before >= 0.5, (1 - usual).clip(_LEAST_FREE, 1.0), 1.0)
        errors = left / free[:, None]
        apart = self.disagreement(errors)
        around = np.partition(apart[self.near], -1 - _NEAR // 4, axis=1)[:, -1 - _NEAR // 4]
        unit = np.maximum(np.maximum(around, np.median(apart)), self.floor / _FULL)
        size = apart / np.maximum(unit * (1 + _RIM * self.rim), 1e-300)
        found = np.asarray(((_NOTHING - size) / (_NOTHING - _FULL)).clip(0.0, 1.0))
        found[np.linalg.norm(left, axis=1) <= self.floor] = 1.0
        suspects = np.flatnonzero(found < 1)
        found[suspects[self._supported(errors, suspects)]] = 1.0
        return found

    def _supported(self, errors: Floats, suspects: Ints) -> Bools:
        """Which of the suspects (s,) have neighbours that deviate the same way."""
        around = errors[self.near[suspects]]
        middle = np.median(around, axis=1)
        own, others = errors[suspects] - middle, around - middle[:, None]
        along = np.einsum("sc,snc->sn", own, others)
        length = np.linalg.norm(own, axis=1)[:, None]
        alike = along >= _SHARE * length**2
        alike &= along >= _SAME_WAY * length * np.linalg.norm(others, axis=2)
        return np.asarray(alike.sum(axis=1) >= _SUPPORT)
