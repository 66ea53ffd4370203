"""Volumes and mass properties of trimmed B-spline faces, by Gauss quadrature.

The flux of x / 3 through a face is the integral of ``f(u, v) = x · (x_u × x_v) / 3`` over the
inside of its outline. By Green's theorem that is the integral of ``F dv`` round the outline, with
``F(u, v)`` the integral of f from the surface's lowest u to u along the line of constant v. Both
are cut at the knot lines, so every piece is a polynomial and the rules are exact; outlines need no
triangulation, and holes no special case.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bezier import bernstein, pieces_of
from ffdcli.brep.evaluate.bspline import SurfaceBatch, chunks, project, sums
from ffdcli.brep.evaluate.lookup import Model, model_of_brep
from ffdcli.brep.evaluate.trim import TrimSegments, expand, outlines
from ffdcli.brep.record import Brep, MassProperties

# The better of two rules does where they agree to this share of the mean flux. What it is off by
# is a far smaller share, as the errors of successive rules fall like powers (seen: below 1e-14).
AGREE = 1e-10
# Centroids and areas have no exact rule; receivers compare them to percents only.
AGREE_LOOSELY = 1e-6
# Points evaluated at once.
POINTS = 16384

# (points (..., 3), cross products of tangents (..., 3)) -> integrands (..., k)
Integrand = Callable[[Floats, Floats], Floats]


def volume_of_brep(brep: Brep) -> tuple[Floats, Floats]:
    """Signed volumes of the shells and solids of a record.

    Returns
    -------
    shells : (S,) float64, cubed model length
        Negative for a cavity. For an open shell, the flux through it relative to the centre.
    solids : (number of solids,) float64
    """
    model = model_of_brep(brep)
    return shell_volumes(model, outlines(model), centre_of(model))


def centre_of(model: Model) -> Floats:
    """(3,) centre of the model's bounding box, the origin that loses the fewest digits."""
    points = model.read.points
    if not len(points):
        return np.zeros(3)
    middle: Floats = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle


def shell_volumes(model: Model, lines: TrimSegments, centre: Floats) -> tuple[Floats, Floats]:
    """Signed volume of every shell and of every solid, relative to an origin (3,)."""
    read = model.read
    flux = face_fluxes(model, lines, centre)
    shells = sums(read.face_shell, flux, len(read.shell_solid))
    bounding = read.shell_solid >= 0
    return shells, sums(read.shell_solid[bounding], shells[bounding], read.solid_count)


def mass_properties(
    model: Model, lines: TrimSegments, centre: Floats
) -> tuple[Floats, Floats, list[MassProperties]]:
    """Volumes as by :func:`shell_volumes`, and the mass properties of every solid.

    Volumes are exact up to rounding. Areas have a relative error of about 1e-9, centroids an error
    of about 1e-9 of the model's size.
    """
    read = model.read
    size = float(np.linalg.norm(np.ptp(read.points, axis=0))) if len(read.points) else 0.0
    agree = np.array([AGREE, AGREE_LOOSELY, *[AGREE_LOOSELY * size] * 3])

    def integrand(points: Floats, products: Floats) -> Floats:
        arm = points - centre
        flux = (arm * products).sum(axis=-1, keepdims=True)
        area = np.sqrt((products * products).sum(axis=-1, keepdims=True))
        return np.concatenate([flux / 3, area, arm * (flux / 4)], axis=-1)

    def limits(found: Floats) -> Floats:
        volume, area = np.abs(found[:, :2]).mean(axis=0)
        return np.array([volume, area, volume, volume, volume]) * agree

    found = _integrals(model, lines, integrand, limits)
    # Outlines of faces that are reversed against their surfaces run backwards.
    found[:, 1] = np.abs(found[:, 1])
    shells = sums(read.face_shell, found, len(read.shell_solid))
    bounding = read.shell_solid >= 0
    solids = sums(read.shell_solid[bounding], shells[bounding], read.solid_count)
    with np.errstate(divide="ignore", invalid="ignore"):
        middles = centre + solids[:, 2:] / solids[:, :1]
    properties = [
        MassProperties(volume, area, (x, y, z))
        for (volume, area), (x, y, z) in zip(solids[:, :2].tolist(), middles.tolist(), strict=True)
    ]
    return shells[:, 0], solids[:, 0], properties


def face_fluxes(model: Model, lines: TrimSegments, centre: Floats) -> Floats:
    """(F,) flux of (x - centre) / 3 outwards through every face, cubed model length."""

    def integrand(points: Floats, products: Floats) -> Floats:
        return ((points - centre) * products).sum(axis=-1, keepdims=True) / 3

    def limits(found: Floats) -> Floats:
        return AGREE * np.abs(found).mean(axis=0)

    return _integrals(model, lines, integrand, limits)[:, 0]


def _integrals(
    model: Model, lines: TrimSegments, integrand: Integrand, limits: Callable[[Floats], Floats]
) -> Floats:
    """(F, k) integrals over faces; the order of the rules rises until two agree within limits."""
    nothing = integrand(np.zeros((0, 3)), np.zeros((0, 3)))
    found = np.zeros((model.read.face_count, nothing.shape[-1]))
    for batch in model.faces:
        rules = _rules(batch, nothing.shape[-1] > 1)
        strips = _strips(batch, lines)
        todo = np.arange(len(batch.owners))
        best = _batch_integrals(batch, strips, todo, rules[0], integrand)
        for rule in rules[1:]:
            better = _batch_integrals(batch, strips, todo, rule, integrand)
            open_still = (np.abs(better - best[todo]) > limits(better)).any(axis=1)
            best[todo] = better
            todo = todo[open_still]
            if not len(todo):
                break
        found[batch.owners] = best
    return found


def _rules(batch: SurfaceBatch, areas: bool) -> list[tuple[int, int]]:
    """Numbers of Gauss points round the outline and along u: two lower rules, then the exact one.

    Quotients and areas have no exact rule: further rules with two, four and eight times the points
    of the exact polynomial rule follow, and are used only until two agree.
    """
    along = -(-3 * batch.degrees[0] // 2)
    around = -(-3 * sum(batch.degrees) // 2)
    shares = [3, 2, 1] if around * along > 40 else [1]
    rules = [(-(-around // share), -(-along // share)) for share in shares]
    if batch.rational or areas:
        rules += [(more * around, more * along) for more in (2, 4, 8)]
    return rules


@dataclass(frozen=True)
class _Strips:
    """Strips between a piece of an outline and the surface's lowest u, cut at its knot lines.

    Parameters
    ----------
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

    row: Ints
    ends: Floats
    points: Floats
    corner: Floats
    size: Floats
    whole: Bools


def _strips(batch: SurfaceBatch, lines: TrimSegments) -> _Strips:
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
    return _Strips(row, ends, points, corner, stop - corner, span < at_u[piece])


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


def _batch_integrals(
    batch: SurfaceBatch,
    strips: _Strips,
    rows: Ints,
    rule: tuple[int, int],
    integrand: Integrand,
) -> Floats:
    """(len(rows), k) integrals over faces of one batch by one rule."""
    place = np.full(len(batch.owners), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    used = np.flatnonzero(place[strips.row] >= 0)
    share, weights = _gauss(rule[0])
    nothing = integrand(np.zeros((0, 3)), np.zeros((0, 3)))
    total = np.zeros((len(rows), nothing.shape[-1]))
    for part in chunks(len(used), max(1, POINTS // (rule[0] * rule[1]))):
        strip = used[part]
        start, stop = strips.ends[strip, 0], strips.ends[strip, 1]
        uv = start[:, None] + share[:, None] * (stop - start)[:, None]
        inner = _along_u(batch, strips, strip, uv, rule[1], integrand)
        amount = weights / 2 @ inner * (stop - start)[:, 1:]
        total += sums(place[strips.row[strip]], amount, len(rows))
    return total


def _along_u(
    batch: SurfaceBatch,
    strips: _Strips,
    strip: Ints,
    uv: Floats,
    count: int,
    integrand: Integrand,
) -> Floats:
    """(s, n, k) integrals over strips with v fixed, at outline points ``uv`` (s, n, 2).

    Strips of the last piece extend to the outline even if rounding puts it beyond the last knot.
    Before the first knot they run backwards.
    """
    degree_u, degree_v = batch.degrees
    corner, size = strips.corner[strip], strips.size[strip]
    values, slopes = bernstein(degree_v, (uv[..., 1] - corner[:, None, 1]) / size[:, None, 1])
    slopes /= size[:, None, 1, None]
    # Contract along v once: a curve in u, and its derivative along v, remain.
    net = strips.points[strip].reshape(len(strip), degree_v + 1, -1)
    held = (len(strip), uv.shape[1], degree_u + 1, net.shape[2] // (degree_u + 1))
    curves = np.concatenate([(values @ net).reshape(held), (slopes @ net).reshape(held)], axis=3)
    share, weights = _gauss(count)
    width = np.where(strips.whole[strip, None], 1.0, (uv[..., 0] - corner[:, :1]) / size[:, :1])
    values, slopes = bernstein(degree_u, width[..., None] * share)
    both = values @ curves
    components = held[3]
    slope_u = slopes @ curves[..., :components] / size[:, None, None, :1]
    slope = np.stack([slope_u, both[..., components:]], axis=-2)
    point, tangents = project(both[..., :components], slope, batch.rational)
    products = _cross(tangents[..., 0, :], tangents[..., 1, :])
    value = weights @ integrand(point, products)
    return value * (width * size[:, :1] / 2)[..., None]


def _cross(first: Floats, second: Floats) -> Floats:
    """Cross products (..., 3); several times faster than ``np.cross``."""
    a, b, c = np.moveaxis(first, -1, 0)
    d, e, f = np.moveaxis(second, -1, 0)
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)


@lru_cache(maxsize=64)
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes, as shares of an interval, and weights, which add up to 2."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights
