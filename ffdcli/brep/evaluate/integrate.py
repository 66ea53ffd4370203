"""Volumes and mass properties of trimmed B-spline faces, by Gauss quadrature.

The flux of x / 3 through a face is the integral of ``f(u, v) = x · (x_u × x_v) / 3`` over the
inside of its outline. By Green's theorem that is the integral of ``F dv`` round the outline, with
``F(u, v)`` the integral of f from the surface's lowest u to u along the line of constant v. Both
are cut at the knot lines, so every piece is a polynomial and the rules are exact; outlines need no
triangulation, and holes no special case. Quotients and areas have no exact rule: their pieces are
divided until two rules agree, and the error is estimated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bezier import bernstein, pieces_of
from ffdcli.brep.evaluate.bspline import SurfaceBatch, chunks, groups, project, sums
from ffdcli.brep.evaluate.lookup import Model, model_of_brep
from ffdcli.brep.evaluate.quadrature import AGREE, Integrals, error_of, gauss, refine
from ffdcli.brep.evaluate.trim import TrimSegments, expand, outlines
from ffdcli.brep.record import Brep, MassProperties

# Numbers of Gauss points, in both directions, on parts of divided strips: the better has half more.
RULES = ((8, 8), (12, 12))
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
    shells, solids, _ = shell_volumes(model, outlines(model), centre_of(model))
    return shells, solids


def centre_of(model: Model) -> Floats:
    """(3,) centre of the model's bounding box, the origin that loses the fewest digits."""
    points = model.read.points
    if not len(points):
        return np.zeros(3)
    middle: Floats = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle


def shell_volumes(
    model: Model, lines: TrimSegments, centre: Floats
) -> tuple[Floats, Floats, Floats]:
    """Signed volume of every shell and solid, relative to an origin (3,), and the shells' errors.

    The errors (S,) are 0 for polynomial faces, whose volumes are exact up to rounding.
    """
    read = model.read

    def integrand(points: Floats, products: Floats) -> Floats:
        return ((points - centre) * products).sum(axis=-1, keepdims=True) / 3

    def scales(found: Floats) -> Floats:
        return np.abs(found).mean(axis=0)

    flux, error = _integrals(model, lines, integrand, scales)
    shells = sums(read.face_shell, flux[:, 0], len(read.shell_solid))
    errors = sums(read.face_shell, error[:, 0], len(read.shell_solid))
    bounding = read.shell_solid >= 0
    solids = sums(read.shell_solid[bounding], shells[bounding], read.solid_count)
    return shells, solids, errors


def mass_properties(
    model: Model, lines: TrimSegments, centre: Floats
) -> tuple[Floats, Floats, list[MassProperties]]:
    """Volumes as by :func:`shell_volumes`, and the mass properties of every solid."""
    read = model.read
    size = float(np.linalg.norm(np.ptp(read.points, axis=0))) if len(read.points) else 0.0

    def integrand(points: Floats, products: Floats) -> Floats:
        arm = points - centre
        flux = (arm * products).sum(axis=-1, keepdims=True)
        area = np.sqrt((products * products).sum(axis=-1, keepdims=True))
        return np.concatenate([flux / 3, area, arm * (flux / 4)], axis=-1)

    def scales(found: Floats) -> Floats:
        volume, area = np.abs(found[:, :2]).mean(axis=0)
        return np.array([volume, area, *[volume * size] * 3])

    found, error = _integrals(model, lines, integrand, scales)
    # Outlines of faces that are reversed against their surfaces run backwards.
    found[:, 1] = np.abs(found[:, 1])
    both = np.concatenate([found, error], axis=1)
    shells = sums(read.face_shell, both, len(read.shell_solid))
    bounding = read.shell_solid >= 0
    solids, errors = np.hsplit(
        sums(read.shell_solid[bounding], shells[bounding], read.solid_count), 2
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = solids[:, 2:] / solids[:, :1]
        # Of a quotient: the error of the moment, and that of the volume times the quotient.
        shift = (errors[:, 2:] + np.abs(offset) * errors[:, :1]) / np.abs(solids[:, :1])
    numbers = np.column_stack([solids[:, :2], errors[:, :2], np.linalg.norm(shift, axis=1)])
    properties = [
        MassProperties(volume, area, (x, y, z), volume_error, area_error, centroid_error)
        for (volume, area, volume_error, area_error, centroid_error), (x, y, z) in zip(
            numbers.tolist(), (centre + offset).tolist(), strict=True
        )
    ]
    return shells[:, 0], solids[:, 0], properties


def _integrals(
    model: Model, lines: TrimSegments, integrand: Integrand, scales: Callable[[Floats], Floats]
) -> Integrals:
    """(F, k) integrals over faces and their errors.

    The order of the rules rises until two agree; strips of faces where none do are divided.
    ``scales`` gives the size (k,) of the integrals, by which errors are judged.
    """
    size = integrand(np.zeros((0, 3)), np.zeros((0, 3))).shape[-1]
    found, errors = np.zeros((2, model.read.face_count, size))
    hard = []
    for batch in model.faces:
        exact = not batch.rational and size == 1
        rules = _rules(batch, exact)
        strips = _strips(batch, lines)
        todo = np.arange(len(batch.owners))
        best = _by_rule(batch, strips, todo, rules[0], integrand)
        error = np.zeros_like(best)
        for rule in rules[1:]:
            better = _by_rule(batch, strips, todo, rule, integrand)
            difference, scale = np.abs(better - best[todo]), scales(better)
            best[todo], error[todo] = better, error_of(difference, scale)
            todo = todo[(difference > AGREE * scale).any(axis=1)]
            if not len(todo):
                break
        if exact:
            error[todo] = 0.0
        elif len(todo):
            hard.append(_Hard(batch, strips, np.flatnonzero(np.isin(strips.row, todo))))
            best[todo] = error[todo] = 0.0
        found[batch.owners], errors[batch.owners] = best, error
    if hard:
        face, more = _divided(hard, integrand, scales(found))
        found += sums(face, more.values, len(found))
        errors += sums(face, more.errors, len(found))
    return Integrals(found, errors)


def _rules(batch: SurfaceBatch, exact: bool) -> list[tuple[int, int]]:
    """Numbers of Gauss points round the outline and along u: two lower rules, then the exact one.

    If it is not exact, as the integrand is no polynomial, one of twice its points follows.
    """
    along = -(-3 * batch.degrees[0] // 2)
    around = -(-3 * sum(batch.degrees) // 2)
    shares = [3, 2, 1] if around * along > 40 else [1]
    rules = [(-(-around // share), -(-along // share)) for share in shares]
    return rules if exact else [*rules, (2 * around, 2 * along)]


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


class _Hard(NamedTuple):
    """Strips ``rows`` of a batch's faces that no rule for whole strips is good enough for."""

    batch: SurfaceBatch
    strips: _Strips
    rows: Ints


def _divided(hard: list[_Hard], integrand: Integrand, scale: Floats) -> tuple[Ints, Integrals]:
    """Faces (n,) of all hard strips, and their integrals, found by dividing them."""
    number = np.repeat(np.arange(len(hard)), [len(one.rows) for one in hard])
    strip = np.concatenate([one.rows for one in hard])
    face = np.concatenate([one.batch.owners[one.strips.row[one.rows]] for one in hard])

    def rules(owner: Ints, shares: Floats) -> tuple[Floats, Floats]:
        low, high = np.empty((2, len(owner), len(scale)))
        for which, part in groups(number[owner]):
            one, rows = hard[which], strip[owner[part]]
            for rule, into in zip(RULES, (low, high), strict=True):
                into[part] = _amounts(one.batch, one.strips, rows, shares[part], rule, integrand)
        return low, high

    whole = np.tile([0.0, 1.0], (len(strip), 2, 1))
    points = sum(around * along for around, along in RULES)
    return face, refine(np.arange(len(strip)), whole, rules, _quarters, scale, points)


def _quarters(shares: Floats) -> Floats:
    """(n, 4, 2, 2) quarters of pairs of intervals (n, 2, 2)."""
    middle = shares.mean(axis=2)
    halves = [np.stack([shares[..., 0], middle], -1), np.stack([middle, shares[..., 1]], -1)]
    return np.stack([np.stack([a[:, 0], b[:, 1]], 1) for a in halves for b in halves], axis=1)


def _by_rule(
    batch: SurfaceBatch, strips: _Strips, rows: Ints, rule: tuple[int, int], integrand: Integrand
) -> Floats:
    """(len(rows), k) integrals over faces of one batch by one rule."""
    place = np.full(len(batch.owners), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    used = np.flatnonzero(place[strips.row] >= 0)
    whole = np.broadcast_to([0.0, 1.0], (len(used), 2, 2))
    amounts = _amounts(batch, strips, used, whole, rule, integrand)
    return sums(place[strips.row[used]], amounts, len(rows))


def _amounts(
    batch: SurfaceBatch,
    strips: _Strips,
    rows: Ints,
    shares: Floats,
    rule: tuple[int, int],
    integrand: Integrand,
) -> Floats:
    """(n, k) integrals over parts of strips ``rows`` (n,) by one rule.

    ``shares`` (n, 2, 2) are the intervals of the parts, from 0 to 1 for whole strips: along the
    piece of the outline, and from its lowest u.
    """
    share, weights = gauss(rule[0])
    amounts = []
    for part in chunks(len(rows), max(1, POINTS // (rule[0] * rule[1]))):
        strip, (low, high) = rows[part], np.moveaxis(shares[part, 0], 1, 0)[..., None]
        start, way = strips.ends[strip, 0], strips.ends[strip, 1] - strips.ends[strip, 0]
        at = low + share * (high - low)
        uv = start[:, None] + at[..., None] * way[:, None]
        inner = _along_u(batch, strips, strip, uv, shares[part, 1], rule[1], integrand)
        amounts.append(weights / 2 @ inner * (way[:, 1:] * (high - low)))
    return np.concatenate(amounts or [integrand(np.zeros((0, 3)), np.zeros((0, 3)))])


def _along_u(
    batch: SurfaceBatch,
    strips: _Strips,
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
    degree_u, degree_v = batch.degrees
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
    point, tangents = project(both[..., :components], slope, batch.rational)
    products = _cross(tangents[..., 0, :], tangents[..., 1, :])
    value = weights @ integrand(point, products)
    return value * (width * (high - low) * size[:, :1] / 2)[..., None]


def _cross(first: Floats, second: Floats) -> Floats:
    """Cross products (..., 3); several times faster than ``np.cross``."""
    a, b, c = np.moveaxis(first, -1, 0)
    d, e, f = np.moveaxis(second, -1, 0)
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)
