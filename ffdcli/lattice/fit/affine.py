"""The affine displacement next to some pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats

# Relative spread of the places along a direction below which their field does not tell the slope.
_FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class AffineField:
    """The displacement ``shift + slope (x - middle)``.

    Parameters
    ----------
    middle, shift : (3,) float64
    slope : (3, 3) float64
    rank : int
        From 1 to 4: 4 where the pairs tell all of it.
    applies : bool
        Whether the lattice can have the field.
    """

    middle: Floats
    shift: Floats
    slope: Floats
    rank: int
    applies: bool = True

    def at(self, places: Floats) -> Floats:
        """Displacements (m, 3) at places (m, 3)."""
        return np.asarray(self.shift + (places - self.middle) @ self.slope.T)


def nearest_affine(places: Floats, wanted: Floats, weights: Floats) -> AffineField:
    """The affine field nearest to displacements (m, 3) at places (m, 3), by least squares.

    In directions along which the places do not differ it is constant.
    """
    shares = (weights / weights.sum())[:, None]
    middle, shift = (shares * places).sum(axis=0), (shares * wanted).sum(axis=0)
    arms = places - middle
    rows, goals = np.sqrt(shares) * arms, np.sqrt(shares) * (wanted - shift)
    left, values, right = np.linalg.svd(rows, full_matrices=False)
    told = values > _FLAT * max(float(values.max(initial=0.0)), 1e-300)
    # Below its rounding an extent is none.
    told &= values > 1e-14 * float(np.abs(places).max(initial=0.0))
    part = (left[:, told].T @ goals) / values[told, None]
    slope = (right[told].T @ part).T
    return AffineField(middle, shift, slope, 1 + int(told.sum()))
