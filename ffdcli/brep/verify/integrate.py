"""Volume, centroid and area of bodies of trimmed B-spline faces, by Gauss quadrature.

The flux of x / 3 through a face is the integral of ``f(u, v) = x · (x_u × x_v) / 3`` over the
inside of its outline. By Green's theorem that is the integral of ``F dv`` round the outline, with
``F(u, v)`` the integral of f from the surface's lowest u to u along the line of constant v. Both
are cut at the knot lines, so every piece is a polynomial and the rules are exact; outlines need no
triangulation, and holes no care. First moments (the flux of x_i x / 4) and areas go the same way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffdcli.brep.record import Brep, Floats, Ints, MassProperties
from ffdcli.brep.verify.bspline import SurfaceBatch, basis, chunks, project, sums
from ffdcli.brep.verify.model import Model, model_of_brep
from ffdcli.brep.verify.trim import Outlines, expand, outlines

# The better of two rules does where they agree to this share of the mean flux. What it is off by
# is a far smaller share, as the errors of successive rules fall like powers (seen: below 1e-14).
AGREE = 1e-10
# Centroids and areas, which have no exact rule, are asked for less: receivers compare percents.
AGREE_LOOSELY = 1e-6
# Points on outlines per pass.
POINTS = 4096


# What to integrate at points (..., 3) with the products of tangents (..., 3) there: (..., k).
Integrand = Callable[[Floats, Floats], Floats]


def volume_of_brep(brep: Brep) -> tuple[Floats, Floats]:
    """Signed volume of every shell and solid of a record that was not written yet.

    Returns
    -------
    shells : (S,) float64, cubed model length
        Negative for a cavity. Of an open shell: the flux through it from the model's centre.
    solids : (number of solids,) float64
    """
    model = model_of_brep(brep)
    return shell_volumes(model, outlines(model), centre_of(model))


def centre_of(model: Model) -> Floats:
    """(3,) middle of the box round the model: an origin near which no digits are lost."""
    points = model.read.points
    if not len(points):
        return np.zeros(3)
    middle: Floats = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle


def shell_volumes(model: Model, lines: Outlines, centre: Floats) -> tuple[Floats, Floats]:
    """Signed volume of every shell and of every solid, relative to an origin (3,)."""
    read = model.read
    flux = face_fluxes(model, lines, centre)
    shells = sums(read.face_shell, flux, len(read.shell_solid))
    bounding = read.shell_solid >= 0
    return shells, sums(read.shell_solid[bounding], shells[bounding], read.solid_count)


def mass_properties(
    model: Model, lines: Outlines, centre: Floats
) -> tuple[Floats, Floats, list[MassProperties]]:
    """Volumes as of :func:`shell_volumes`, and the mass properties of every solid.

    Volumes are good to rounding; areas and centroids to about 1e-9 of themselves and of the
    model's size.
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


def face_fluxes(model: Model, lines: Outlines, centre: Floats) -> Floats:
    """(F,) flux of (x - centre) / 3 outwards through every face, cubed model length."""

    def integrand(points: Floats, products: Floats) -> Floats:
        return ((points - centre) * products).sum(axis=-1, keepdims=True) / 3

    def limits(found: Floats) -> Floats:
        return AGREE * np.abs(found).mean(axis=0)

    return _integrals(model, lines, integrand, limits)[:, 0]


def _integrals(
    model: Model, lines: Outlines, integrand: Integrand, limits: Callable[[Floats], Floats]
) -> Floats:
    """(F, k) integrals over every face, by rules of rising order until two agree within limits."""
    nothing = integrand(np.zeros((0, 3)), np.zeros((0, 3)))
    found = np.zeros((model.read.face_count, nothing.shape[-1]))
    for batch in model.faces:
        rules = _rules(batch, nothing.shape[-1] > 1)
        pieces = _cut_at_knots(batch, lines)
        todo = np.arange(len(batch.owners))
        best = _batch_integrals(batch, pieces, todo, rules[0], integrand)
        for rule in rules[1:]:
            better = _batch_integrals(batch, pieces, todo, rule, integrand)
            open_still = (np.abs(better - best[todo]) > limits(better)).any(axis=1)
            best[todo] = better
            todo = todo[open_still]
            if not len(todo):
                break
        found[batch.owners] = best
    return found


def _rules(batch: SurfaceBatch, areas: bool) -> list[tuple[int, int]]:
    """Numbers of Gauss points round the outline and along u: two lower rules, then the exact one.

    Quotients and areas have no exact rule: the last ones have two, four and eight times the points
    that would do for the volume of a polynomial, and are used only as far as the ones before do
    not agree.
    """
    along = -(-3 * batch.degrees[0] // 2)
    around = -(-3 * sum(batch.degrees) // 2)
    shares = [3, 2, 1] if around * along > 40 else [1]
    rules = [(-(-around // share), -(-along // share)) for share in shares]
    if batch.rational or areas:
        rules += [(more * around, more * along) for more in (2, 4, 8)]
    return rules


def _cut_at_knots(batch: SurfaceBatch, lines: Outlines) -> tuple[Ints, Floats]:
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
    pieces: tuple[Ints, Floats],
    rows: Ints,
    rule: tuple[int, int],
    integrand: Integrand,
) -> Floats:
    """(len(rows), k) integrals over faces of one batch by one rule."""
    owner, ends = pieces
    place = np.full(len(batch.owners), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    # A piece with dv = 0 adds nothing.
    used = np.flatnonzero((place[owner] >= 0) & (ends[:, 0, 1] != ends[:, 1, 1]))
    nodes, weights = np.polynomial.legendre.leggauss(rule[0])
    share = (nodes + 1) / 2
    nothing = integrand(np.zeros((0, 3)), np.zeros((0, 3)))
    total = np.zeros((len(rows), nothing.shape[-1]))
    for part in chunks(len(used), max(1, POINTS // rule[0])):
        piece = used[part]
        way = ends[piece, 1] - ends[piece, 0]
        uv = (ends[piece, 0, None] + share[:, None] * way[:, None]).reshape(-1, 2)
        row = np.repeat(owner[piece], rule[0])
        inner = _along_u(batch, row, uv, rule[1], integrand)
        amount = weights / 2 @ inner.reshape(len(piece), rule[0], -1) * way[:, 1:]
        total += sums(place[owner[piece]], amount, len(rows))
    return total


def _along_u(
    batch: SurfaceBatch, row: Ints, uv: Floats, count: int, integrand: Integrand
) -> Floats:
    """(n, k) integral along the surface from its lowest u to u, with v fixed."""
    size = batch.poles.shape[-1]
    degree_u, degree_v = batch.degrees
    first, values, slopes = basis(degree_v, batch.v_knots[row], batch.v_mults, uv[:, 1])
    # Contract along v once: what is left is a curve in u, with its derivative across.
    net = batch.poles[
        row[:, None, None],
        np.arange(batch.poles.shape[1])[:, None],
        (first[:, None] + np.arange(degree_v + 1))[:, None, :],
    ]
    across = np.stack([values, slopes], axis=1)[:, None]
    curves = (across @ net).reshape(len(row), -1, 2 * size)
    spans = batch.u_knots[row]
    low = spans[:, :-1]
    # Beyond the last knot the last polynomial goes on, so that a rounding there does no harm.
    high = np.concatenate([spans[:, 1:-1], np.full((len(row), 1), np.inf)], axis=1)
    high = np.minimum(high, uv[:, :1])
    first_low = low[:, 0]
    reached = high > low
    # Before the first knot the integral runs backwards, over the first polynomial.
    reached[:, 0] |= uv[:, 0] < first_low
    owner, span = np.nonzero(reached)
    nodes, weights = np.polynomial.legendre.leggauss(count)
    share = (nodes + 1) / 2
    start, width = low[owner, span], high[owner, span] - low[owner, span]
    at = start[:, None] + width[:, None] * share
    # The knots of each piece's own span decide the polynomial, not the position of its nodes.
    first, values, slopes = basis(
        degree_u,
        np.repeat(spans[owner], count, axis=0),
        batch.u_mults,
        at.ravel(),
    )
    reach = first.reshape(-1, count)[:, :1] + np.arange(degree_u + 1)
    block = curves[owner[:, None], reach]
    both = np.stack([values, slopes], axis=1).reshape(len(owner), 2 * count, degree_u + 1) @ block
    both = both.reshape(len(owner), count, 2, 2, size)
    slope = np.stack([both[:, :, 1, 0], both[:, :, 0, 1]], axis=2)
    point, tangents = project(both[:, :, 0, 0], slope, batch.rational)
    normal = np.cross(tangents[..., 0, :], tangents[..., 1, :])
    value = weights @ integrand(point, normal) * (width / 2)[:, None]
    return sums(owner, value, len(row))
