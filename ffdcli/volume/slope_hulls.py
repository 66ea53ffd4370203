"""Balls that contain the derivatives of a deformation on boxes, from the Bézier points there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.polynomials import multiply, raise_degrees
from ffdcli.volume.protocol import Volume

# Boxes treated together: bounds the memory.
_CHUNK = 256
# Bound of the rounding, relative to the product of the columns' lengths.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class SlopeHulls:
    """Balls around the derivatives on m boxes.

    Parameters
    ----------
    centres : (m, 3, 3) float64
        Column a for the derivative along axis a.
    radii : (m, 3) float64
        Largest distance of each column from its centre.
    """

    centres: Floats
    radii: Floats

    def longest(self) -> Floats:
        """(m, 3) upper bounds of the columns' lengths."""
        return np.asarray(np.linalg.norm(self.centres, axis=1) + self.radii)

    def least_determinant(self, sense: int) -> Floats:
        """(m,) lower bounds of ``sense * det J``.

        A determinant is linear in its columns and at most the product of their lengths. So it
        differs from that of the centres by at most ``prod(c_a + r_a) - prod(c_a)``.
        """
        lengths = np.linalg.norm(self.centres, axis=1)
        most = np.prod(lengths + self.radii, axis=1)
        change = most - np.prod(lengths, axis=1)
        return np.asarray(sense * np.linalg.det(self.centres) - change - _ROUNDING * most)


def slope_hulls(
    volume: Volume,
    cells: Ints,
    boxes: Floats,
    *,
    sharp: bool = False,
    nets: Sequence[Floats] = (),
) -> Iterator[SlopeHulls]:
    """Hulls of the derivatives of a volume with positive weights, in parts of the boxes.

    Parameters
    ----------
    cells : (m, 3) int64
        The polynomial cell of each box.
    boxes : (m, 2, 3) float64
        Low and high corners.
    sharp : bool
        Combine a difference of two quotients into one quotient, at twenty times the cost.
    nets : control nets, shaped as ``volume.net``, optional
        The Bernstein coefficients of a net that depends on a further variable: the hulls hold the
        derivatives for all of its values.

    Notes
    -----
    The derivative of a quotient is ``(N' W - N W') / W^2``. With numerator and denominator of one
    degree, with coefficients n_i and q_i > 0, it is a mean of the n_i / q_i, with weights q_i B_i.
    """
    for start in range(0, len(cells), _CHUNK):
        ends = boxes[start : start + _CHUNK]
        part = cells[start : start + _CHUNK]
        restriction = volume.restrict(part, ends[:, 0], ends[:, 1])
        points = restriction.apply(volume.net)
        if nets:
            points = np.stack([restriction.apply(net) for net in nets], axis=-2)
        extent = ends[:, 1] - ends[:, 0]
        if sharp and points.shape[-1] == 8:
            points = _one_quotient(points)
        columns = [_column(volume, points, extent, axis) for axis in range(3)]
        yield SlopeHulls(
            np.stack([centre for centre, _ in columns], axis=2),
            np.stack([radius for _, radius in columns], axis=1),
        )


def count_products(volume: Volume, *, sharp: bool, nets: int = 1) -> int:
    """About the number of multiplications that the hull of one box is worth.

    Its loops are short: each multiplication takes as long as four of a determinant's form.
    """
    double = volume.net_kind.components == 8
    terms = [nets, *(k + 1 for k in volume.degrees)]
    joined = double and sharp
    size = int(np.prod([2 * n - 1 for n in terms] if joined else terms))
    # Along each axis three forms of three, three and one components, for each quotient.
    return 4 * 3 * 7 * size * size * (2 if double and not joined else 1)


def _one_quotient(points: Floats) -> Floats:
    """``N / W - N0 / W0`` as one quotient: forms (m, ..., 4) of twice the degree."""
    vectors, weights, before, base = np.split(points, [3, 4, 7], axis=-1)
    above = multiply(vectors, base) - multiply(before, weights)
    return np.concatenate([above, multiply(weights, base)], axis=-1)


def _column(volume: Volume, points: Floats, extent: Floats, axis: int) -> tuple[Floats, Floats]:
    """Centres (m, 3) and radii (m,) of the derivatives along an axis."""
    if points.shape[-1] < 8:
        centre, radius = _ball(_slope_forms(points, extent, axis))
    else:
        # Quotients with a common denominator are combined.
        inner = tuple(range(1, points.ndim - 1))
        one = np.all(points[..., 3] == points[..., 7], axis=inner)
        centre, radius = np.empty((len(points), 3)), np.empty(len(points))
        joined = points[one, ..., :4].copy()
        joined[..., :3] -= points[one, ..., 4:7]
        centre[one], radius[one] = _ball(_slope_forms(joined, extent[one], axis))
        edited = _ball(_slope_forms(points[~one, ..., :4], extent[~one], axis))
        before = _ball(_slope_forms(points[~one, ..., 4:], extent[~one], axis))
        centre[~one], radius[~one] = edited[0] - before[0], edited[1] + before[1]
    if volume.net_kind.displaces:
        centre += np.eye(3)[axis]
    return centre, radius


def _ball(vectors: Floats) -> tuple[Floats, Floats]:
    """Centres (m, 3) of vectors (m, ..., 3), and distances (m,) of the farthest ones."""
    flat = vectors.reshape(len(vectors), int(np.prod(vectors.shape[1:-1])), 3)
    centre = (flat.min(axis=1) + flat.max(axis=1)) / 2
    return centre, np.linalg.norm(flat - centre[:, None], axis=2).max(axis=1)


def _slope_forms(points: Floats, extent: Floats, axis: int) -> Floats:
    """Vectors (m, ..., 3) whose hull contains the derivative of ``N`` or of ``N / W``."""
    degree = points.shape[1 + axis] - 1
    slope = np.diff(points, axis=1 + axis) * degree
    slope /= extent[:, axis].reshape(-1, *(1,) * (points.ndim - 1))
    if points.shape[-1] == 3:
        return slope
    weights = points[..., 3:]
    below = multiply(weights, weights)
    above = multiply(slope[..., :3], weights) - multiply(points[..., :3], slope[..., 3:])
    return np.asarray(raise_degrees(above, [n - 1 for n in below.shape[1:-1]]) / below)
