"""Control points with weights, and their homogeneous form."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Floats


def homogeneous(points: Floats, weights: Floats) -> Floats:
    """Homogeneous control points, or the points themselves where weights are equal.

    Parameters
    ----------
    points : (..., 3) float64
    weights : (...) float64
        Positive.

    Returns
    -------
    (..., 3 or 4) float64
        ``(w x, w y, w z, w)``; the points unchanged where all weights are equal, since they cancel
        and the volume is polynomial.
    """
    if np.all(weights == weights.flat[0]):
        return points
    return np.concatenate([weights[..., None] * points, weights[..., None]], axis=-1)


def rational_basis(basis: csr_array, weights: Floats) -> csr_array:
    """The rational basis ``R = w N / sum w N`` (Hu et al. 2001, Eq. 2) from the polynomial one.

    Parameters
    ----------
    basis : (m, n) sparse
        Basis functions N at m points.
    weights : (n,) float64

    Returns
    -------
    (m, n) sparse
        Rows add up to 1.
    """
    if np.all(weights == weights.flat[0]):
        return basis
    values = basis.data * weights[basis.indices]
    owner = np.repeat(np.arange(basis.shape[0]), np.diff(basis.indptr))
    totals = np.bincount(owner, values, minlength=basis.shape[0])
    return csr_array((values / totals[owner], basis.indices, basis.indptr), shape=basis.shape)


def cartesian(points: Floats) -> Floats:
    """Cartesian points (..., 3) of Cartesian or homogeneous points."""
    return points[..., :3] / points[..., 3:] if points.shape[-1] == 4 else points
