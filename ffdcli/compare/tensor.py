"""Tensor-product patches in orthonormal frames, as in Feng 2002.

All coplanar sub-polygons of a knot box share one patch over their bounding rectangle in the frame
of Table 1. Its bi-degree is at most (k_u + k_v) x (k_u + k_v + k_w); its control points follow by
interpolation (Eq. 3 and 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.compare.continued import evaluate_continued, project
from ffdcli.splines.polynomials import binomials
from ffdcli.surface.partition import Partition
from ffdcli.surface.plane_graphs import PlaneGraphs
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class TensorPatches:
    """Bézier patches of one pair of degrees.

    Parameters
    ----------
    patches : (m,) int64
        Numbers in the partition.
    degrees : (int, int)
        Degrees along s and t.
    corner : (m, 3) float64, lattice frame
        Lowest corner of the undeformed rectangle.
    sides : (m, 2, 3) float64
        Sides of the rectangle along s and t.
    control_points : (m, ns + 1, nt + 1, 3 or 4) float64, lattice frame
        Homogeneous if the volume has weights.
    """

    patches: Ints
    degrees: tuple[int, int]
    corner: Floats
    sides: Floats
    control_points: Floats

    def evaluate(self, points: Floats) -> Floats:
        """Images (m, q, 3) of points (m, q, 3) in the undeformed plane of each patch."""
        arm = points - self.corner[:, None]
        square = np.einsum("mji,mji->mj", self.sides, self.sides)
        place = np.einsum("mqi,mji->mqj", arm, self.sides) / square[:, None]
        along_s, along_t = (
            _bernstein(degree, place[..., i]) for i, degree in enumerate(self.degrees)
        )
        return project(np.einsum("mqi,mqj,mijd->mqd", along_s, along_t, self.control_points))


def interpolate_rectangles(parts: Partition, volume: Volume) -> tuple[TensorPatches, ...]:
    """Patches of a partition that was cut at every knot plane.

    Only parts inside the lattice box have patches; the others stay planar.
    """
    which = np.flatnonzero(parts.inside)
    frames = _frames(parts.graphs.take(which), volume)
    corner, sides = _rectangles(parts, which, frames)
    cells = volume.cells((parts.low + parts.high)[which] / 2)
    degrees = (frames != 0) @ np.array(volume.degrees)
    out = []
    for pair in np.unique(degrees, axis=0).tolist():
        rows = np.flatnonzero((degrees == pair).all(axis=1))
        ns, nt = (volume.net_kind.degree(degree) for degree in pair)
        s, t = np.meshgrid(np.arange(ns + 1) / ns, np.arange(nt + 1) / nt, indexing="ij")
        sites = np.stack([s.ravel(), t.ravel()], axis=1)
        places = corner[rows, None] + sites @ sides[rows]
        samples = evaluate_continued(volume, cells[rows], places)
        grid = samples.reshape(len(rows), ns + 1, nt + 1, -1)
        # The lower degree first, as in the paper.
        for axis in (1, 2) if ns <= nt else (2, 1):
            grid = _solve(grid, axis)
        out.append(TensorPatches(which[rows], (ns, nt), corner[rows], sides[rows], grid))
    return tuple(out)


def _frames(graphs: PlaneGraphs, volume: Volume) -> Floats:
    """Unit vectors s and t of Table 1, (m, 2, 3); zero components are exactly 0."""
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
    # plane contains one.
    highest = int(np.argmax(volume.degrees))
    s = np.cross(np.eye(3)[highest], normal)
    flat = np.flatnonzero(zero.any(axis=1))
    first = np.where(zero[flat].sum(axis=1) == 2, axes[flat, 1], np.argmax(zero[flat], axis=1))
    s[flat] = np.eye(3)[first]
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return np.stack([s, np.cross(normal, s)], axis=1)


def _rectangles(parts: Partition, which: Ints, frames: Floats) -> tuple[Floats, Floats]:
    """Lowest corners (m, 3) and sides (m, 2, 3) of the bounding rectangles of patches."""
    row = np.full(len(parts.group), -1, dtype=np.int64)
    row[which] = np.arange(len(which))
    pieces = parts.pieces
    vertices = pieces.vertices[:, 0]
    patch = row[parts.patch[parts.region[pieces.owner]]]
    points, patch = vertices[pieces.corners[patch >= 0]], patch[patch >= 0]
    anchor = np.empty((len(which), 3))
    anchor[patch] = points
    place = np.einsum("nji,ni->nj", frames[patch], points - anchor[patch])
    low, high = np.full((len(which), 2), np.inf), np.full((len(which), 2), -np.inf)
    np.minimum.at(low, patch, place)
    np.maximum.at(high, patch, place)
    corner = anchor + np.einsum("mj,mji->mi", low, frames)
    return corner, (high - low)[:, :, None] * frames


def _solve(samples: Floats, axis: int) -> Floats:
    """Bézier points along an axis from samples at uniform parameters (Eq. 3)."""
    degree = samples.shape[axis] - 1
    matrix = _bernstein(degree, np.arange(degree + 1) / degree)
    front = np.moveaxis(samples, axis, 0)
    solved = np.linalg.solve(matrix, front.reshape(degree + 1, -1)).astype(np.float64)
    return np.moveaxis(solved.reshape(front.shape), 0, axis)


def _bernstein(degree: int, places: Floats) -> Floats:
    """Values (..., degree + 1) of the Bernstein polynomials at parameters (...)."""
    index = np.arange(degree + 1)
    at = places[..., None]
    return np.asarray(binomials(degree) * at**index * (1 - at) ** (degree - index))
