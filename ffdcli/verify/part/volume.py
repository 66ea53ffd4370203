"""Flux through the trimmed faces of a deformed shape, by integrals along their pcurves."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.quadrature import gauss, refine
from ffdcli.verify.part.shape import DeformedShape

# Points across a piece by the lower and by the better rule; points that count for the effort. Each
# costs four times as much as one of our own surfaces.
RULES = (6, 9)
_POINTS = 4 * (RULES[0] ** 2 + RULES[1] ** 2)


def shell_fluxes(
    image: DeformedShape, centre: Floats, accuracy: float
) -> tuple[Floats, Floats, Floats]:
    """Flux of (x - centre) / 3 through every shell, its error, and its area, (S,) each.

    By Green's theorem, the integral over a face is that of its integral along u, from the lowest u
    to the pcurve, along all pcurves. Pieces of pcurves are divided, in both directions, until two
    rules agree.

    Parameters
    ----------
    image : DeformedShape
    centre : (3,) float64, model length
    accuracy : float, model length
        Error wanted: that of moving all faces by this length.
    """
    shape = image.shape
    coedge, pieces = _pieces(image)
    face_low = np.array([u[0] for u, _ in shape.face_breaks])

    def rule(coedge: Ints, pieces: Floats, count: int) -> Floats:
        nodes, weights = gauss(count)
        grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
        both = np.outer(weights, weights).ravel() / 4
        spans = pieces[:, 1] - pieces[:, 0]
        at = (pieces[:, None, 0] + grid * spans[:, None]).reshape(-1, 2)
        owner = np.repeat(coedge, len(grid))
        face = shape.coedge_face[owner]
        # The nodes of a grid share their places on the pcurve, count each.
        firsts = np.arange(0, len(owner), count)
        uv, along = (
            np.repeat(each, count, axis=0)
            for each in shape.on_pcurves(owner[firsts], at[firsts, 0])
        )
        width = uv[:, 0] - face_low[face]
        uv[:, 0] = face_low[face] + at[:, 1] * width
        position, sides = image.on_faces(face, uv)
        normal = np.cross(sides[:, 0], sides[:, 1])
        amount = width * along[:, 1]
        flux = ((position - centre) * normal).sum(axis=1) / 3 * amount
        area = np.linalg.norm(normal, axis=1) * amount
        values = np.stack([flux, area], axis=1).reshape(len(coedge), -1, 2)
        total: Floats = np.einsum("npk,p->nk", values, both) * spans.prod(axis=1)[:, None]
        return total

    def rules(coedge: Ints, pieces: Floats) -> tuple[Floats, Floats]:
        low, high = (rule(coedge, pieces, count) for count in RULES)
        # The area is wanted roughly only.
        low[:, 1] = high[:, 1]
        return low, high

    count = len(shape.coedge_face)
    shells = len(shape.shell_closed)
    if not len(coedge):
        return (np.zeros(shells),) * 3
    # About the outward normal loops run forwards, about the surface's normal faces that are turned
    # run backwards: so areas have the sense of the loop times that of the face, fluxes have it
    # twice.
    sense = np.where(shape.coedge_forward, 1.0, -1.0)
    turned = np.where(shape.face_reversed[shape.coedge_face], -1.0, 1.0)
    first = rule(coedge, pieces, RULES[0])
    area = abs((first[:, 1] * (sense * turned)[coedge]).sum())
    mean = np.abs(first[:, 0]).mean()
    scale = np.array([max(mean, np.finfo(float).tiny), 1.0])
    agree = accuracy * area / len(coedge) / scale[0]
    found = refine(coedge, pieces, rules, _quarters, scale, _POINTS, agree)
    values, errors = np.zeros((2, count, 2))
    values[: len(found.values)], errors[: len(found.errors)] = found
    shell = shape.face_shell[shape.coedge_face]
    return (
        sums(shell, values[:, 0] * sense, shells),
        sums(shell, errors[:, 0], shells),
        sums(shell, values[:, 1] * sense * turned, shells),
    )


def _pieces(image: DeformedShape) -> tuple[Ints, Floats]:
    """Coedges, and rectangles (n, 2, 2) of a pcurve's parameter and the share of the way along u.

    Pcurves along u add nothing.
    """
    owners, pieces = [], []
    for coedge, breaks in enumerate(image.shape.coedge_breaks):
        if breaks[-1] > breaks[0]:
            cells = np.zeros((len(breaks) - 1, 2, 2))
            cells[:, 0, 0], cells[:, 1, 0], cells[:, 1, 1] = breaks[:-1], breaks[1:], 1.0
            owners.append(np.full(len(cells), coedge))
            pieces.append(cells)
    owner = np.concatenate([np.zeros(0, dtype=np.int64), *owners])
    cells = np.concatenate([np.zeros((0, 2, 2)), *pieces])
    inner = cells[:, 0, 0, None] + [0.25, 0.5, 0.75] * np.diff(cells[:, :, 0], axis=1)
    uv, along = image.shape.on_pcurves(np.repeat(owner, 3), inner.ravel())
    face = image.shape.coedge_face[owner]
    low = np.array([u[0] for u, _ in image.shape.face_breaks])[face]
    rising = np.any(along[:, 1].reshape(-1, 3) != 0, axis=1)
    wide = np.any(uv[:, 0].reshape(-1, 3) != low[:, None], axis=1)
    kept = rising & wide
    return owner[kept], cells[kept]


def _quarters(pieces: Floats) -> Floats:
    """(n, 4, 2, 2) quarters of rectangles (n, 2, 2) of lower and upper corners."""
    middle = pieces.mean(axis=1)
    out = np.empty((len(pieces), 4, 2, 2))
    for number, (first, second) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        for axis, upper in enumerate((first, second)):
            out[:, number, 0, axis] = middle[:, axis] if upper else pieces[:, 0, axis]
            out[:, number, 1, axis] = pieces[:, 1, axis] if upper else middle[:, axis]
    return out
