"""Volume enclosed by trimmed B-spline faces, by Gauss quadrature.

The flux of x / 3 through a face is the integral of ``f(u, v) = x · (x_u × x_v) / 3`` over the
inside of its outline. By Green's theorem that is the integral of ``F dv`` round the outline, with
``F(u, v)`` the integral of f from the surface's lowest u to u along the line of constant v. Both
are cut at the knot lines, so every piece is a polynomial and the rules are exact; outlines need no
triangulation, and holes no care.
"""

from __future__ import annotations

import numpy as np

from ffdcli.brep.record import Brep, Floats, Ints
from ffdcli.brep.verify.bspline import SurfaceBatch, basis, chunks, project, sums
from ffdcli.brep.verify.model import Model, model_of_brep
from ffdcli.brep.verify.trim import Outlines, expand, outlines

# The better of two rules does where they agree to this share of the mean flux. What it is off by
# is a far smaller share, as the errors of successive rules fall like powers (seen: below 1e-14).
AGREE = 1e-10
# Points on outlines per pass.
POINTS = 4096


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


def face_fluxes(model: Model, lines: Outlines, centre: Floats) -> Floats:
    """(F,) flux of (x - centre) / 3 outwards through every face, cubed model length."""
    flux = np.zeros(model.read.face_count)
    for batch in model.faces:
        rules = _rules(batch)
        pieces = _cut_at_knots(batch, lines)
        todo = np.arange(len(batch.owners))
        best = _batch_fluxes(batch, pieces, todo, rules[0], centre)
        for rule in rules[1:]:
            better = _batch_fluxes(batch, pieces, todo, rule, centre)
            limit = AGREE * np.abs(better).sum() / len(flux)
            open_still = np.abs(better - best[todo]) > limit
            best[todo] = better
            todo = todo[open_still]
            if not len(todo):
                break
        flux[batch.owners] = best
    return flux


def _rules(batch: SurfaceBatch) -> list[tuple[int, int]]:
    """Numbers of Gauss points round the outline and along u: two lower rules, then the exact one.

    Quotients have no exact rule: the last ones have two, four and eight times the points that
    would do for a polynomial, and are used only as far as the ones before do not agree.
    """
    along = -(-3 * batch.degrees[0] // 2)
    around = -(-3 * sum(batch.degrees) // 2)
    shares = [3, 2, 1] if around * along > 40 else [1]
    rules = [(-(-around // share), -(-along // share)) for share in shares]
    if batch.rational:
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


def _batch_fluxes(
    batch: SurfaceBatch,
    pieces: tuple[Ints, Floats],
    rows: Ints,
    rule: tuple[int, int],
    centre: Floats,
) -> Floats:
    """(len(rows),) fluxes through faces of one batch by one rule."""
    owner, ends = pieces
    place = np.full(len(batch.owners), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    # A piece with dv = 0 adds nothing.
    used = np.flatnonzero((place[owner] >= 0) & (ends[:, 0, 1] != ends[:, 1, 1]))
    nodes, weights = np.polynomial.legendre.leggauss(rule[0])
    share = (nodes + 1) / 2
    total = np.zeros(len(rows))
    for part in chunks(len(used), max(1, POINTS // rule[0])):
        piece = used[part]
        way = ends[piece, 1] - ends[piece, 0]
        uv = (ends[piece, 0, None] + share[:, None] * way[:, None]).reshape(-1, 2)
        row = np.repeat(owner[piece], rule[0])
        inner = _along_u(batch, row, uv, rule[1], centre).reshape(len(piece), rule[0])
        amount = inner @ weights / 2 * way[:, 1]
        total += sums(place[owner[piece]], amount, len(rows))
    return total


def _along_u(batch: SurfaceBatch, row: Ints, uv: Floats, count: int, centre: Floats) -> Floats:
    """(n,) integral of x · (x_u × x_v) / 3 from the surface's lowest u to u, with v fixed."""
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
    value = ((point - centre) * normal).sum(axis=2) @ weights * width / 6
    return sums(owner, value, len(row))
