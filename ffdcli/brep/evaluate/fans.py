"""Integrals over the inside of outlines on one polynomial piece, as fans of triangles.

The triangles from one vertex of a face to all segments of its outline add up, with their signs, to
the inside of the outline, holes included. For a triangular face that is one triangle. A triangle is
the image of a unit square whose one side shrinks to the vertex (Duffy 1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bernstein import bernstein
from ffdcli.brep.evaluate.bspline import SurfaceBatch, chunks, project
from ffdcli.brep.evaluate.integrands import POINTS, Integrand, Rule, cross
from ffdcli.brep.evaluate.quadrature import gauss
from ffdcli.brep.evaluate.trim import TrimSegments, expand


@dataclass(frozen=True)
class Fans:
    """Triangles on surfaces of one polynomial piece.

    Parameters
    ----------
    batch : SurfaceBatch
        Without interior knots.
    row : (n,) int64
        Surface in the batch.
    corners : (n, 3, 2) float64, surface parameters
    """

    batch: SurfaceBatch
    row: Ints
    corners: Floats

    def rules(self, exact: bool) -> list[Rule]:
        """Numbers of Gauss points along the sides: each half more, up to the exact one.

        If it is not ``exact``, as the integrand is no polynomial, one of twice its points follows.
        """
        most = -(-3 * sum(self.batch.degrees) // 2)
        counts = [max(2, -(-2 * most // 9))]
        while (more := -(-3 * counts[-1] // 2)) < most:
            counts.append(more)
        counts = [*counts, most] if exact else [*counts, most, 2 * most]
        return [(count, count) for count in counts]

    def amounts(self, rows: Ints, shares: Floats, rule: Rule, integrand: Integrand) -> Floats:
        """(n, k) integrals over parts of triangles ``rows`` (n,) by one rule.

        ``shares`` (n, 2, 2) are the intervals of the parts, from 0 to 1 for whole triangles: along
        the segment of the outline, and from the vertex to it.
        """
        (along, along_weights), (out, out_weights) = map(gauss, rule)
        weights = np.outer(along_weights, out_weights).ravel() / 4
        amounts = []
        for part in chunks(len(rows), max(1, POINTS // len(weights))):
            a, b, c = np.moveaxis(self.corners[rows[part]], 1, 0)
            low, size = shares[part, :, 0], np.diff(shares[part], axis=2)[..., 0]
            t = (low[:, :1] + along * size[:, :1])[:, :, None, None]
            s = (low[:, 1:] + out * size[:, 1:])[:, None, :, None]
            way = (b - a)[:, None, None] + t * (c - b)[:, None, None]
            uv = a[:, None, None] + s * way
            first, second = b - a, c - a
            area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
            reach = np.broadcast_to(s[..., 0], uv.shape[:3]).reshape(len(a), -1)
            found = _integrands(self.batch, self.row[rows[part]], uv.reshape(len(a), -1, 2),
                                integrand)  # fmt: skip
            inner = ((weights * reach)[:, None] @ found)[:, 0]
            amounts.append(inner * (area * size.prod(axis=1))[:, None])
        return np.concatenate(amounts or [integrand(np.zeros((0, 3)), np.zeros((0, 3)))])


def fans_of(batch: SurfaceBatch, lines: TrimSegments) -> Fans:
    """The triangles of a batch's faces, each from the first point of the outline."""
    row, place = expand(np.diff(lines.starts)[batch.owners])
    first = lines.starts[batch.owners][row]
    corners = np.concatenate([lines.ends[first, :1], lines.ends[first + place]], axis=1)
    # The segments that meet the vertex have no triangle.
    apart: Bools = np.any(corners[:, 1:] != corners[:, :1], axis=2).all(axis=1)
    return Fans(batch, row[apart], corners[apart])


def _integrands(batch: SurfaceBatch, row: Ints, uv: Floats, integrand: Integrand) -> Floats:
    """(n, m, k) integrands at surface parameters (n, m, 2) of surfaces ``row`` (n,)."""
    degree_u, degree_v = batch.degrees
    ends = np.stack([batch.u_knots[row][:, [0, -1]], batch.v_knots[row][:, [0, -1]]], axis=1)
    size = np.diff(ends, axis=2)[:, None, :, 0]
    at = (uv - ends[:, None, :, 0]) / size
    u, du = bernstein(degree_u, at[..., 0])
    v, dv = bernstein(degree_v, at[..., 1])
    poles = batch.poles[row]
    count = poles.shape[-1]
    # Contract along v: a curve in u for each point, and its derivative along v, remain.
    net = poles.swapaxes(1, 2).reshape(len(row), degree_v + 1, -1)
    held = (*uv.shape[:2], degree_u + 1, count)
    across, across_v = (v @ net).reshape(held), (dv @ net).reshape(held)
    point, slope_u, slope_v = (
        np.einsum("nmi,nmic->nmc", values, curves)
        for values, curves in ((u, across), (du, across), (u, across_v))
    )
    slopes = np.stack([slope_u / size[..., :1], slope_v / size[..., 1:]], axis=-2)
    point, tangents = project(point, slopes, batch.rational)
    return integrand(point, cross(tangents[..., 0, :], tangents[..., 1, :]))
