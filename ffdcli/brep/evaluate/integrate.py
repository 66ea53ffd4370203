"""Volumes and mass properties of trimmed B-spline faces, by Gauss quadrature.

The flux of x / 3 through a face is the integral of ``f(u, v) = x · (x_u × x_v) / 3`` over the
inside of its outline, which is parted into regions on one polynomial piece each (`fans`,
`strips`): there the rules are exact. Quotients and areas have no exact rule: their regions are
divided until two rules agree, and the error is estimated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import groups, sums
from ffdcli.brep.evaluate.fans import fans_of
from ffdcli.brep.evaluate.integrands import Integrand, Regions, Rule
from ffdcli.brep.evaluate.lookup import Model, model_of_brep
from ffdcli.brep.evaluate.quadrature import AGREE, Integrals, error_of, refine
from ffdcli.brep.evaluate.strips import strips_of
from ffdcli.brep.evaluate.trim import TrimSegments, outlines
from ffdcli.brep.record import Brep, MassProperties

# Numbers of Gauss points, both ways, on parts of divided regions; the better has half more.
RULES = ((8, 8), (12, 12))


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

    The order of the rules rises until two agree; regions of faces where none do are divided.
    ``scales`` gives the size (k,) of the integrals, by which errors are judged.
    """
    size = integrand(np.zeros((0, 3)), np.zeros((0, 3))).shape[-1]
    found, errors = np.zeros((2, model.read.face_count, size))
    hard = []
    for batch in model.faces:
        exact = not batch.rational and size == 1
        one_piece = len(batch.u_mults) == len(batch.v_mults) == 2
        regions: Regions = fans_of(batch, lines) if one_piece else strips_of(batch, lines)
        rules = regions.rules(exact)
        todo = np.arange(len(batch.owners))
        best = _by_rule(regions, todo, rules[0], integrand)
        error = np.zeros_like(best)
        for rule in rules[1:]:
            better = _by_rule(regions, todo, rule, integrand)
            difference, scale = np.abs(better - best[todo]), scales(better)
            best[todo], error[todo] = better, error_of(difference, scale)
            todo = todo[(difference > AGREE * scale).any(axis=1)]
            if not len(todo):
                break
        if exact:
            error[todo] = 0.0
        elif len(todo):
            hard.append(_Hard(regions, np.flatnonzero(np.isin(regions.row, todo))))
            best[todo] = error[todo] = 0.0
        found[batch.owners], errors[batch.owners] = best, error
    if hard:
        face, more = _divided(hard, integrand, scales(found))
        found += sums(face, more.values, len(found))
        errors += sums(face, more.errors, len(found))
    return Integrals(found, errors)


class _Hard(NamedTuple):
    """Regions ``rows`` of faces that no rule for whole regions is good enough for."""

    regions: Regions
    rows: Ints


def _divided(hard: list[_Hard], integrand: Integrand, scale: Floats) -> tuple[Ints, Integrals]:
    """Faces (n,) of all hard regions, and their integrals, found by dividing them."""
    number = np.repeat(np.arange(len(hard)), [len(one.rows) for one in hard])
    region = np.concatenate([one.rows for one in hard])
    face = np.concatenate([one.regions.batch.owners[one.regions.row[one.rows]] for one in hard])

    def rules(owner: Ints, shares: Floats) -> tuple[Floats, Floats]:
        low, high = np.empty((2, len(owner), len(scale)))
        for which, part in groups(number[owner]):
            one, rows = hard[which], region[owner[part]]
            for rule, into in zip(RULES, (low, high), strict=True):
                into[part] = one.regions.amounts(rows, shares[part], rule, integrand)
        return low, high

    whole = np.tile([0.0, 1.0], (len(region), 2, 1))
    points = sum(around * along for around, along in RULES)
    return face, refine(np.arange(len(region)), whole, rules, _quarters, scale, points)


def _quarters(shares: Floats) -> Floats:
    """(n, 4, 2, 2) quarters of pairs of intervals (n, 2, 2)."""
    middle = shares.mean(axis=2)
    halves = [np.stack([shares[..., 0], middle], -1), np.stack([middle, shares[..., 1]], -1)]
    return np.stack([np.stack([a[:, 0], b[:, 1]], 1) for a in halves for b in halves], axis=1)


def _by_rule(regions: Regions, rows: Ints, rule: Rule, integrand: Integrand) -> Floats:
    """(len(rows), k) integrals over faces of one batch by one rule."""
    place = np.full(len(regions.batch.owners), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    used = np.flatnonzero(place[regions.row] >= 0)
    whole = np.broadcast_to([0.0, 1.0], (len(used), 2, 2))
    amounts = regions.amounts(used, whole, rule, integrand)
    return sums(place[regions.row[used]], amounts, len(rows))
