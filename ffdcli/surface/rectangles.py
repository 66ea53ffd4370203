"""Bounding rectangles of planar regions in the frames of Feng 2002, Table 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.surface.plane_graphs import PlaneGraphs


@dataclass(frozen=True)
class Rectangles:
    """The rectangles of Q patches, with orthonormal parameters ``s`` and ``t`` from 0 on.

    Parameters
    ----------
    corner : (Q, 3) float64, lattice frame
        Where both parameters are 0.
    axes : (Q, 2, 3) float64
        Unit vectors along s and t; components that Table 1 gives as 0 are exactly 0.
    extent : (Q, 2) float64
        Lengths of the sides.
    """

    corner: Floats
    axes: Floats
    extent: Floats

    def parameters(self, points: Floats, patches: Ints) -> Floats:
        """Parameters (m, n, 2) of points (m, n, 3) in the planes of patches (m,)."""
        arm = points - self.corner[patches, None]
        place = np.einsum("mni,mji->mnj", arm, self.axes[patches])
        # Rounding may take them out of the domain of the surface.
        return np.clip(place, 0.0, self.extent[patches, None])

    def points(self, parameters: Floats, patches: Ints) -> Floats:
        """Points (m, n, 3) of the planes of patches (m,) at parameters (m, n, 2)."""
        along = np.einsum("mnj,mji->mni", parameters, self.axes[patches])
        return self.corner[patches, None] + along

    @property
    def corners(self) -> Floats:
        """(Q, 4, 3) corners of the rectangles."""
        ends = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
        return self.points(ends * self.extent[:, None], np.arange(len(self.corner)))


def bounding_rectangles(
    graphs: PlaneGraphs, degrees: Ints, points: Floats, owner: Ints
) -> Rectangles:
    """The rectangles of Q patches.

    Parameters
    ----------
    graphs : PlaneGraphs
        Planes (Q,).
    degrees : (Q, 3) int64
        Degrees of the volume that each patch lies in.
    points : (n, 3) float64, lattice frame
        Vertices of the patches.
    owner : (n,) int64
        Patch of each.
    """
    count = len(degrees)
    rows, axes = np.arange(count), _frames(graphs, degrees)
    anchor = np.empty((count, 3))
    # Every patch has a vertex.
    anchor[owner] = points
    a, b, c = graphs.axes.T
    anchor[rows, a] = graphs.height(rows, anchor[rows, b], anchor[rows, c])
    place = np.einsum("nji,ni->nj", axes[owner], points - anchor[owner])
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, owner, place)
    np.maximum.at(high, owner, place)
    return Rectangles(anchor + np.einsum("mj,mji->mi", low, axes), axes, high - low)


def _frames(graphs: PlaneGraphs, degrees: Ints) -> Floats:
    """Unit vectors s and t (Q, 2, 3) of Table 1, with ``t = n × s`` in all rows.

    In its fifth row, for ``n = (n_x, 0, n_z)``, the paper's t has the opposite sign.
    """
    axes = graphs.axes
    rows = np.arange(len(axes))
    normal = np.zeros((len(axes), 3))
    # (e_b, e_c, sign e_a) is right-handed, with the outward normal on the side of sign e_a.
    sign = np.where((axes[:, 1] - axes[:, 0]) % 3 == 1, 1.0, -1.0)
    normal[rows, axes[:, 0]] = sign
    normal[rows, axes[:, 1]] = -sign * graphs.slopes[:, 0]
    normal[rows, axes[:, 2]] = -sign * graphs.slopes[:, 1]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    zero = normal == 0
    # Perpendicular to the normal and to the axis of highest degree; along a lattice axis if the
    # plane contains one: the next one after the normal if it contains two.
    s = np.cross(np.eye(3)[np.argmax(degrees, axis=1)], normal)
    flat = np.flatnonzero(zero.any(axis=1))
    next_one = (axes[flat, 0] + 1) % 3
    s[flat] = np.eye(3)[np.where(zero[flat].sum(axis=1) == 2, next_one, np.argmax(zero[flat], 1))]
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return np.stack([s, np.cross(normal, s)], axis=1)
