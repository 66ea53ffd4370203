"""Integrals over the inside of outlines, as strips between the outlines and the lowest u.

By Green's theorem the integral of f(u, v) is that of ``F dv`` round the outline, with ``F(u, v)``
the integral of f from the surface's lowest u to u along the line of constant v. Both are cut at the
knot lines, so every strip lies in one polynomial piece; outlines need no triangulation, and holes
no special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bernstein import bernstein
from ffdcli.brep.evaluate.bezier import pieces_of
from ffdcli.brep.evaluate.bspline import SurfaceBatch, chunks, project
from ffdcli.brep.evaluate.integrands import POINTS, Integrand, Rule, cross
from ffdcli.brep.evaluate.quadrature import gauss
from ffdcli.brep.evaluate.trim import TrimSegments, expand


@dataclass(frozen=True)
class Strips:
    """Strips between a piece of an outline and the surface's lowest u, cut at its knot lines.

    Parameters
    ----------
    batch : SurfaceBatch
    row : (n,) int64
        Surface in the batch.
    ends : (n, 2, 2) float64, surface parameters
        Ends of the piece of the outline.
    points : (n, degree_v + 1, degree_u + 1, 3 or 4) float64
        Bézier points of the polynomial piece that contains the strip.
    corner, size : (n, 2) float64
        Low corner and side lengths of that piece's knot rectangle.
    whole : (n,) bool
        True if the strip ends at the next knot, false if it ends at the outline.
    """

    batch: SurfaceBatch
    row: Ints
    ends: Floats
    points: Floats
    corner: Floats
    size: Floats
    whole: Bools

    def rules(self, exact: bool) -> list[Rule]:
        """Numbers of Gauss points round the outline and along u: two lower rules, the exact one.

        If it is not ``exact``, as the integrand is no polynomial, one of twice its points follows.
        """
        along = -(-3 * self.batch.degrees[0] // 2)
        around = -(-3 * sum(self.batch.degrees) // 2)
        shares = [3, 2, 1] if around * along > 40 else [1]
        rules = [(-(-around // share), -(-along // share)) for share in shares]
        return rules if exact else [*rules, (2 * around, 2 * along)]

    def amounts(self, rows: Ints, shares: Floats, rule: Rule, integrand: Integrand) -> Floats:
        """(n, k) integrals over parts of strips ``rows`` (n,) by one rule.

        ``shares`` (n, 2, 2) are the intervals of the parts, from 0 to 1 for whole strips: along the
        piece of the outline, and from its lowest u.
        """
        share, weights = gauss(rule[0])
        amounts = []
        for part in chunks(len(rows), max(1, POINTS // (rule[0] * rule[1]))):
            strip, (low, high) = rows[part], np.moveaxis(shares[part, 0], 1, 0)[..., None]
            start, way = self.ends[strip, 0], self.ends[strip, 1] - self.ends[strip, 0]
            at = low + share * (high - low)
            uv = start[:, None] + at[..., None] * way[:, None]
            inner = _along_u(self, strip, uv, shares[part, 1], rule[1], integrand)
            amounts.append(weights / 2 @ inner * (way[:, 1:] * (high - low)))
        return np.concatenate(amounts or [integrand(np.zeros((0, 3)), np.zeros((0, 3)))])


def strips_of(batch: SurfaceBatch, lines: TrimSegments) -> Strips:
    """Strips that cover the region between the outlines of a batch's faces and the lowest u."""
    row, ends = _cut_at_knots(batch, lines)
    # A piece with dv = 0 adds nothing.
    used = ends[:, 0, 1] != ends[:, 1, 1]
    row, ends = row[used], ends[used]
    middle = ends.mean(axis=1)
    at_u, at_v = (
        (middle[:, axis, None] >= knots[row, 1:-1]).sum(axis=1)
        for axis, knots in enumerate((batch.u_knots, batch.v_knots))
    )
    piece, span = expand(at_u + 1)
    row, ends, at_v = row[piece], ends[piece], at_v[piece]
    corner = np.stack([batch.u_knots[row, span], batch.v_knots[row, at_v]], axis=1)
    stop = np.stack([batch.u_knots[row, span + 1], batch.v_knots[row, at_v + 1]], axis=1)
    points = pieces_of(batch)[row, span, at_v]
    return Strips(batch, row, ends, points, corner, stop - corner, span < at_u[piece])


def _cut_at_knots(batch: SurfaceBatch, lines: TrimSegments) -> tuple[Ints, Floats]:
    """Outlines of a batch's faces cut at its knot lines: row in the batch, ends (n, 2, 2)."""
    row, place = expand(np.diff(lines.starts)[batch.owners])
    ends = lines.ends[lines.starts[batch.owners][row] + place]
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    cuts = [np.zeros((len(row), 1)), np.ones((len(row), 1))]
    for axis, knots in enumerate((batch.u_knots, batch.v_knots)):
        inner = knots[row, 1:-1]
        reach = way[:, axis, None]
        at = np.divide(
            inner - start[:, axis, None], reach, out=np.zeros_like(inner), where=reach != 0
        )
        cuts.append(np.clip(at, 0.0, 1.0))
    at = np.sort(np.concatenate(cuts, axis=1), axis=1)
    owner, step = np.nonzero(np.diff(at, axis=1) > 0)
    low, high = at[owner, step], at[owner, step + 1]
    pieces = start[owner, None] + np.stack([low, high], axis=1)[:, :, None] * way[owner, None]
    return row[owner], pieces


def _along_u(
    strips: Strips,
    strip: Ints,
    uv: Floats,
    shares: Floats,
    count: int,
    integrand: Integrand,
) -> Floats:
    """(s, n, k) integrals over parts (s, 2) of strips with v fixed, at outline points (s, n, 2).

    Strips of the last piece extend to the outline even if rounding puts it beyond the last knot.
    Before the first knot they run backwards.
    """
    degree_u, degree_v = strips.batch.degrees
    corner, size = strips.corner[strip], strips.size[strip]
    values, slopes = bernstein(degree_v, (uv[..., 1] - corner[:, None, 1]) / size[:, None, 1])
    slopes /= size[:, None, 1, None]
    # Contract along v once: a curve in u, and its derivative along v, remain.
    net = strips.points[strip].reshape(len(strip), degree_v + 1, -1)
    held = (len(strip), uv.shape[1], degree_u + 1, net.shape[2] // (degree_u + 1))
    curves = np.concatenate([(values @ net).reshape(held), (slopes @ net).reshape(held)], axis=3)
    share, weights = gauss(count)
    low, high = shares[:, :1], shares[:, 1:]
    width = np.where(strips.whole[strip, None], 1.0, (uv[..., 0] - corner[:, :1]) / size[:, :1])
    values, slopes = bernstein(degree_u, width[..., None] * (low + share * (high - low))[:, None])
    both = values @ curves
    components = held[3]
    slope_u = slopes @ curves[..., :components] / size[:, None, None, :1]
    slope = np.stack([slope_u, both[..., components:]], axis=-2)
    point, tangents = project(both[..., :components], slope, strips.batch.rational)
    products = cross(tangents[..., 0, :], tangents[..., 1, :])
    value = weights @ integrand(point, products)
    return value * (width * (high - low) * size[:, :1] / 2)[..., None]
