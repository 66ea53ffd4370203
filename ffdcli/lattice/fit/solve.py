"""Weighted least squares with a bending energy that decides where the data is silent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class FitData:
    """Pairs of a fit, in the lattice frame.

    Parameters
    ----------
    places : (m, 3) float64
        Points of the undeformed object, inside the lattice box.
    wanted : (m, 3) float64
        Displacements of their images.
    weights : (m,) float64
        Weights of the squared distances, positive.
    """

    places: Floats
    wanted: Floats
    weights: Floats


@dataclass(frozen=True, eq=False)
class FitBasis:
    """The functions that a fit combines.

    The displacement at the pairs is ``values @ expand @ moves``, its energy
    ``moves @ expand.T @ energy @ expand @ moves``.

    Parameters
    ----------
    values : (m, f) sparse
        Functions at the pairs.
    energy : (f, f) sparse
        Bending energy: mean over the box of the squared second derivatives, times the fourth power
        of the diagonal of the box.
    expand : (f, n) sparse
        Coefficients of the functions for a unit move of each unknown control point.
    unknowns : (n,) int64
        Control points that are solved for.
    """

    values: csr_array
    energy: csr_array
    expand: csr_array
    unknowns: Ints


@dataclass(frozen=True, eq=False)
class Fitted:
    """A solution.

    Parameters
    ----------
    moves : (n, 3) float64
        Moves of the unknown control points.
    left : (m, 3) float64
        What each image lacks to its target.
    outlier : (m,) bool
    noise : float
    smooth : float
    """

    moves: Floats
    left: Floats
    outlier: Bools
    noise: float
    smooth: float


def solve_fit(basis: FitBasis, data: FitData, smooth: float | None, robust: bool) -> Fitted:
    """The moves of least sum of mean squared residual and bending energy."""
    rows = (basis.values @ basis.expand).toarray()
    shares = data.weights / data.weights.sum()
    energy = (basis.expand.T @ basis.energy @ basis.expand).toarray()
    normal = rows.T @ (shares[:, None] * rows)
    weight = 1e-10 if smooth is None else smooth
    moves = np.linalg.lstsq(normal + weight * energy, rows.T @ (shares[:, None] * data.wanted))[0]
    left = data.wanted - rows @ moves
    return Fitted(moves, left, np.zeros(len(left), dtype=bool), 0.0, weight)
