"""Evaluate the polynomial of one knot box, also outside the box (Feng 2002, section 3.4.2)."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.protocol import Volume

# Number of points evaluated at once; limits the memory for the local control points.
_CHUNK = 50_000


def evaluate_continued(volume: Volume, cells: Ints, points: Floats) -> Floats:
    """Images of points by the polynomial of a cell, inside the cell or outside.

    Parameters
    ----------
    cells : (m, 3) int64
    points : (m, n, 3) float64, lattice frame

    Returns
    -------
    (m, n, 3 or 4) float64, lattice frame
        Homogeneous if the volume has weights.
    """
    at, kind = points.reshape(-1, 3), volume.net_kind
    cell = np.repeat(cells, points.shape[1], axis=0)
    out = np.empty((len(at), 4 if kind.rational else 3))
    for start in range(0, len(at), _CHUNK):
        part = slice(start, start + _CHUNK)
        forms = volume.restrict(cell[part], at[part], at[part]).at_low()
        out[part] = kind.complete(forms.apply(volume.net)[:, 0, 0, 0], at[part])
    return out.reshape(*points.shape[:2], -1)


def project(points: Floats) -> Floats:
    """Cartesian points (..., 3) of Cartesian or homogeneous points."""
    return points[..., :3] / points[..., 3:] if points.shape[-1] == 4 else points
