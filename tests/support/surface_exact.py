"""Exact control points in rational arithmetic: the oracle that judges surfaces and curves.

It takes the floats that a plan holds (knots, net, plane, rectangle, breaks) as exact numbers,
samples the volume's polynomial at rational sites, and interpolates those values without rounding,
one direction after the other (Feng 2002, Eq. 3 and 4). It shares no code and no method with the
package, which multiplies Bernstein forms in floating point. Matrices are integers over one
denominator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import comb, lcm

import numpy as np

from ffdcli.surface.curves import EdgeBatch
from ffdcli.surface.patches import PatchBatch
from ffdcli.surface.plane_graphs import PlaneGraphs
from ffdcli.volume.bspline import BSplineVolume

Row = list[Fraction]


@dataclass(frozen=True)
class Exact:
    """An array of rational numbers: integers over one denominator."""

    numerators: np.ndarray
    denominator: int

    def gap(self, computed: np.ndarray) -> float:
        """Largest difference from floating numbers, itself taken exactly."""
        worst = 0.0
        for numerator, value in zip(self.numerators.ravel(), computed.ravel(), strict=True):
            top, bottom = float(value).as_integer_ratio()
            difference = abs(numerator * bottom - top * self.denominator)
            worst = max(worst, difference / (bottom * self.denominator))
        return worst


def fractions(values: Sequence[float]) -> Row:
    return [Fraction(float(value)) for value in values]


def integers(matrix: Sequence[Row]) -> tuple[np.ndarray, int]:
    """The same matrix as Python integers over one common denominator."""
    common = lcm(*(value.denominator for row in matrix for value in row))
    whole = [[value.numerator * (common // value.denominator) for value in row] for row in matrix]
    return np.array(whole, dtype=object), common


@lru_cache(maxsize=4096)
def _basis_coefficients(knots: tuple[float, ...], degree: int) -> tuple[np.ndarray, int]:
    """Power coefficients (degree + 1, degree + 1), lowest first, of one span's basis functions.

    ``knots`` are the 2 degree knots about the span. Cox's recursion by its definition, on
    polynomials, starting from the characteristic function of the span.
    """
    exact = dict(enumerate(fractions(knots), start=1))
    pieces: dict[int, Row] = {degree: [Fraction(1)]}
    for r in range(1, degree + 1):
        raised: dict[int, Row] = {}
        for i in range(degree - r, degree + 1):
            total = [Fraction(0)] * (r + 1)
            if i in pieces:
                width = exact[i + r] - exact[i]
                for power, value in enumerate(pieces[i]):
                    total[power] -= exact[i] / width * value
                    total[power + 1] += value / width
            if i + 1 in pieces:
                width = exact[i + r + 1] - exact[i + 1]
                for power, value in enumerate(pieces[i + 1]):
                    total[power] += exact[i + r + 1] / width * value
                    total[power + 1] -= value / width
            raised[i] = total
        pieces = raised
    whole, common = integers([pieces[i] for i in range(degree + 1)])
    return whole.T, common


def basis_rows(
    knots: np.ndarray, degree: int, span: int, sites: Sequence[Fraction]
) -> tuple[np.ndarray, int]:
    """Basis functions (sites, degree + 1) of one span's polynomial piece, continued to any site."""
    local = tuple(float(x) for x in knots[span - degree + 1 : span + degree + 1])
    coefficients, den = _basis_coefficients(local, degree)
    common = lcm(*(x.denominator for x in sites))
    tops = [x.numerator * (common // x.denominator) for x in sites]
    powers = [[n**j * common ** (degree - j) for j in range(degree + 1)] for n in tops]
    return np.array(powers, dtype=object).dot(coefficients), den * common**degree


@lru_cache(maxsize=32)
def _to_powers(degree: int) -> tuple[np.ndarray, int]:
    """Matrix that takes values at ``i / degree`` to power coefficients: Gauss, without rounding."""
    size = degree + 1
    sites = [Fraction(i, max(degree, 1)) for i in range(size)]
    work = [[x**j for j in range(size)] + [Fraction(i == k) for k in range(size)]
            for i, x in enumerate(sites)]  # fmt: skip
    for i in range(size):
        work[i] = [value / work[i][i] for value in work[i]]
        for r in range(size):
            if r != i:
                factor = work[r][i]
                work[r] = [x - factor * y for x, y in zip(work[r], work[i], strict=True)]
    return integers([row[size:] for row in work])


def values_to_poles(
    knots: Row, degree: int, span: int
) -> tuple[np.ndarray, int, tuple[Fraction, ...]]:
    """Matrix from values at sites in a span to the B-spline's local poles, and the sites.

    The values give the polynomial in powers of the span's own parameter; a pole is then the sum of
    coefficients times elementary symmetric functions of the knots (Marsden's identity).
    """
    low, width = knots[span], knots[span + 1] - knots[span]
    sites = tuple(low + width * Fraction(i, max(degree, 1)) for i in range(degree + 1))
    scaled = [(x - low) / width for x in knots[span - degree + 1 : span + degree + 1]]
    common = lcm(1, *(x.denominator for x in scaled))
    tops = [x.numerator * (common // x.denominator) for x in scaled]
    shares = lcm(*(comb(degree, j) for j in range(degree + 1)))
    dual = []
    for i in range(degree + 1):
        symmetric = [1] + [0] * degree
        for x in tops[i : i + degree]:
            for j in range(degree, 0, -1):
                symmetric[j] += x * symmetric[j - 1]
        dual.append(
            [
                symmetric[j] * common ** (degree - j) * (shares // comb(degree, j))
                for j in range(degree + 1)
            ]
        )
    powers, den = _to_powers(degree)
    return np.array(dual, dtype=object).dot(powers), den * common**degree * shares, sites


def _local_net(volume: BSplineVolume, cell: np.ndarray) -> tuple[np.ndarray, int]:
    """Control points of one cell as integers over a power of two."""
    part = tuple(slice(m - k, m + 1) for m, k in zip(cell, volume.degrees, strict=True))
    local = volume.net[part]
    whole, common = integers([fractions(local.ravel())])
    return whole.reshape(local.shape), common


def _contract(matrix: np.ndarray, array: np.ndarray, axis: int) -> np.ndarray:
    """Apply a matrix along one axis of an array of integers."""
    moved = np.moveaxis(array, axis, 0)
    out = matrix.dot(moved.reshape(moved.shape[0], -1)).reshape(-1, *moved.shape[1:])
    return np.moveaxis(out, 0, axis)


def full_knots(breaks: np.ndarray, mults: np.ndarray, degree: int) -> Row:
    return fractions(np.repeat(breaks, np.concatenate([[degree + 1], mults, [degree + 1]])))


def span_of(piece: int, mults: np.ndarray, degree: int) -> int:
    return degree + int(np.sum(mults[:piece]))


def surface_poles(
    volume: BSplineVolume, graphs: PlaneGraphs, batch: PatchBatch, patch: int, cell: tuple
) -> tuple[Exact, tuple[slice, slice]]:
    """Exact poles (db + 1, dc + 1, 3) that reach one cell of a patch, and where they stand."""
    a, b, c = batch.order
    jb, jc = batch.shape
    p, q = cell
    knot_box = batch.cells[(patch * jb + p) * jc + q]
    spans, inverses = [], []
    for i, piece in enumerate((p, q)):
        knots = full_knots(batch.breaks[i][patch], batch.mults[i], batch.degrees[i])
        spans.append(span_of(piece, batch.mults[i], batch.degrees[i]))
        inverses.append(values_to_poles(knots, batch.degrees[i], spans[i]))
    (inv_b, den_ib, sites_b), (inv_c, den_ic, sites_c) = inverses
    a0, b0, c0 = fractions(graphs.anchor[batch.patches[patch]])
    beta, gamma = fractions(graphs.slopes[batch.patches[patch]])
    net, den_net = _local_net(volume, knot_box)
    net = net.transpose(a, b, c, 3)

    def rows(axis: int, sites: Sequence[Fraction]) -> tuple[np.ndarray, int]:
        k, m = volume.degrees[axis], int(knot_box[axis])
        return basis_rows(volume.knots[axis], k, m, sites)

    basis_b, den_b = rows(b, sites_b)
    basis_c, den_c = rows(c, sites_c)
    heights = [a0 + beta * (s - b0) + gamma * (t - c0) for s in sites_b for t in sites_c]
    basis_a, den_a = rows(a, heights)
    net = _contract(basis_c, _contract(basis_b, net, 1), 2)  # (ka + 1, sites b, sites c, 3)
    basis_a = basis_a.reshape(len(sites_b), len(sites_c), -1)
    values = sum(basis_a[:, :, i, None] * net[i] for i in range(net.shape[0]))
    poles = _contract(inv_c, _contract(inv_b, values, 0), 1)
    common = den_net * den_b * den_c * den_a * den_ib * den_ic
    place = tuple(slice(span - d, span + 1) for span, d in zip(spans, batch.degrees, strict=True))
    return Exact(poles, common), (place[0], place[1])


def curve_poles(
    volume: BSplineVolume,
    start: np.ndarray,
    end: np.ndarray,
    batch: EdgeBatch,
    curve: int,
    piece: int,
) -> tuple[Exact, slice]:
    """Exact poles (degree + 1, 3) that reach one piece of an edge's curve, and where they stand."""
    (count,), (degree,), (mults,) = batch.shape, batch.degrees, batch.mults
    knot_box = batch.restriction.first[curve * count + piece] + np.array(volume.degrees)
    knots = full_knots(batch.breaks[0][curve], mults, degree)
    span = span_of(piece, mults, degree)
    inverse, den_i, sites = values_to_poles(knots, degree, span)
    net, den_net = _local_net(volume, knot_box)
    tables = []
    common = den_net * den_i
    for axis in range(3):
        p, q = Fraction(float(start[axis])), Fraction(float(end[axis]))
        if axis not in batch.running:
            p = q = (p + q) / 2
        k, m = volume.degrees[axis], int(knot_box[axis])
        table, den = basis_rows(volume.knots[axis], k, m, [p + t * (q - p) for t in sites])
        tables.append(table)
        common *= den
    values = []
    for i in range(len(sites)):
        value = net
        for table in tables:
            value = table[i].dot(value.reshape(value.shape[0], -1)).reshape(value.shape[1:])
        values.append(value)
    poles = inverse.dot(np.array(values, dtype=object))
    return Exact(poles, common), slice(span - degree, span + 1)
