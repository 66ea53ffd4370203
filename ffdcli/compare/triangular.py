"""Triangular Bézier patches of degree k_u + k_v + k_w, by interpolation (Feng and Peng 2000)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.protocol import Volume
from ffdcli.volume.weights import cartesian

# Number of points evaluated at once; limits the memory for the local control points.
_CHUNK = 50_000


@dataclass(frozen=True)
class TriangularPatches:
    """Triangular Bézier patches of one degree.

    Parameters
    ----------
    degree : int
    control_points : (N, (degree + 1)(degree + 2) / 2, 3 or 4) float64, lattice frame
        In the order of :func:`lattice_indices`; homogeneous if the volume has weights.
    """

    degree: int
    control_points: Floats

    def evaluate(self, places: Floats) -> Floats:
        """Points (N, q, 3) of all patches at barycentric coordinates (q, 3)."""
        return cartesian(_bernstein(self.degree, places) @ self.control_points)


def interpolate_triangles(volume: Volume, corners: Floats) -> TriangularPatches:
    """Exact images of triangles, each of which lies in one cell of the volume.

    All triangles share one matrix, which depends on the degree alone.

    Parameters
    ----------
    volume : Volume
    corners : (N, 3, 3) float64, lattice frame
    """
    degree = volume.net_kind.degree(sum(volume.degrees))
    places = lattice_indices(degree) / degree
    cells = volume.cells(corners.mean(axis=1))
    samples = _samples(volume, cells, places @ corners)
    count, sites, size = samples.shape
    columns = samples.transpose(1, 0, 2).reshape(sites, -1)
    points = np.asarray(np.linalg.solve(_bernstein(degree, places), columns), dtype=np.float64)
    return TriangularPatches(degree, points.reshape(sites, count, size).swapaxes(0, 1))


def _samples(volume: Volume, cells: Ints, points: Floats) -> Floats:
    """Images of points by the polynomial of a cell.

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
        forms = volume.at_points(cell[part], at[part])
        out[part] = kind.complete(forms.apply(volume.net)[:, 0, 0, 0], at[part])
    return out.reshape(*points.shape[:2], -1)


@lru_cache(maxsize=32)
def lattice_indices(degree: int) -> Ints:
    """Indices (n, 3) with i + j + k = degree of the control points of a triangular patch."""
    rows = [
        (i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)
    ]
    table = np.array(rows, dtype=np.int64)
    table.flags.writeable = False
    return table


def _bernstein(degree: int, places: Floats) -> Floats:
    """Values (q, n) of the triangular Bernstein polynomials at barycentric coordinates (q, 3)."""
    index = lattice_indices(degree)
    factorials = np.array([factorial(i) for i in range(degree + 1)], dtype=np.float64)
    weight = factorials[degree] / factorials[index].prod(axis=1)
    return np.asarray(weight * (places[:, None, :] ** index[None, :, :]).prod(axis=2))
