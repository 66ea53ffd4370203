"""Flux through the trimmed faces of a deformed shape, by integrals along their pcurves."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.quadrature import gauss, refine
from ffdcli.verify.part.shape import DeformedShape

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.sample import SampledShape

# Points across a piece by the lower and by the better rule; points that count for the effort. Each
# costs four times as much as one of our own surfaces.
RULES = (8, 12)
_POINTS = 4 * (RULES[0] ** 2 + RULES[1] ** 2)
# Largest gap between pcurves, as a share of what the face reaches.
_GAP = 0.1


def shell_fluxes(
    image: DeformedShape, centre: Floats, accuracy: float
) -> tuple[Floats, Floats, Floats]:
    """Flux of (x - centre) / 3 through every shell, its error, and its area, (S,) each.

    By Green's theorem, the integral over a face is that of its integral along u, from the lowest u
    to the pcurve, along all pcurves, and along straight lines where pcurves do not meet. Pieces are
    divided, in both directions, until two rules agree.

    Parameters
    ----------
    image : DeformedShape
    centre : (3,) float64, model length
    accuracy : float, model length
        Error wanted: that of moving all faces by this length.
    """
    shape = image.shape
    lines = _Lines.of(shape)
    line, pieces = _pieces(shape, lines)
    face_low = np.array([u[0] for u, _ in shape.face_breaks])

    def rule(line: Ints, pieces: Floats, count: int) -> Floats:
        nodes, weights = gauss(count)
        grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
        both = np.outer(weights, weights).ravel() / 4
        spans = pieces[:, 1] - pieces[:, 0]
        at = (pieces[:, None, 0] + grid * spans[:, None]).reshape(-1, 2)
        owner = np.repeat(line, len(grid))
        face = lines.face[owner]
        # The nodes of a grid share their places on the line, count each.
        firsts = np.arange(0, len(owner), count)
        uv, along = (
            np.repeat(each, count, axis=0) for each in lines.at(owner[firsts], at[firsts, 0])
        )
        width = uv[:, 0] - face_low[face]
        uv[:, 0] = face_low[face] + at[:, 1] * width
        position, sides = image.on_faces(face, uv)
        normal = np.cross(sides[:, 0], sides[:, 1])
        amount = width * along[:, 1]
        flux = ((position - centre) * normal).sum(axis=1) / 3 * amount
        area = np.linalg.norm(normal, axis=1) * amount
        values = np.stack([flux, area], axis=1).reshape(len(line), -1, 2)
        total: Floats = np.einsum("npk,p->nk", values, both) * spans.prod(axis=1)[:, None]
        return total

    def rules(line: Ints, pieces: Floats) -> tuple[Floats, Floats]:
        low, high = (rule(line, pieces, count) for count in RULES)
        # The area is wanted roughly only.
        low[:, 1] = high[:, 1]
        return low, high

    count = len(lines.face)
    shells = len(shape.shell_closed)
    if not len(line):
        return (np.zeros(shells),) * 3
    # About the outward normal loops run forwards, about the surface's normal faces that are turned
    # run backwards: so areas have the sense of the loop times that of the face, fluxes have it
    # twice.
    sense = lines.sense
    turned = np.where(shape.face_reversed[lines.face], -1.0, 1.0)
    first = rule(line, pieces, RULES[0])
    area = abs((first[:, 1] * (sense * turned)[line]).sum())
    mean = np.abs(first[:, 0]).mean()
    scale = np.array([max(mean, np.finfo(float).tiny), 1.0])
    agree = accuracy * area / len(line) / scale[0]
    found = refine(line, pieces, rules, _quarters, scale, _POINTS, agree)
    values, errors = np.zeros((2, count, 2))
    values[: len(found.values)], errors[: len(found.errors)] = found
    shell = shape.face_shell[lines.face]
    return (
        sums(shell, values[:, 0] * sense, shells),
        sums(shell, errors[:, 0], shells),
        sums(shell, values[:, 1] * sense * turned, shells),
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """Pcurves, and behind them lines that close the gaps between them, in surface parameters.

    Parameters
    ----------
    shape : SampledShape
    face : (n,) int64
    sense : (n,) float64
        1 where the loop about the outward normal runs the line forwards, else -1.
    gaps : (g, 2, 2) float64
        From, to.
    """

    shape: SampledShape
    face: Ints
    sense: Floats
    gaps: Floats

    @classmethod
    def of(cls, shape: SampledShape) -> _Lines:
        """The lines of a shape."""
        face, gaps = _gaps(shape)
        sense = np.where(shape.coedge_forward, 1.0, -1.0)
        every = np.concatenate([shape.coedge_face, face])
        return cls(shape, every, np.concatenate([sense, np.ones(len(gaps))]), gaps)

    def at(self, line: Ints, t: Floats) -> tuple[Floats, Floats]:
        """Parameters and derivatives, (n, 2) each, at parameters (n,); of gaps from 0 to 1."""
        gap = line - len(self.shape.coedge_face)
        own = gap < 0
        uv, along = np.empty((2, len(line), 2))
        uv[own], along[own] = self.shape.on_pcurves(line[own], t[own])
        start, end = np.moveaxis(self.gaps[gap[~own]], 1, 0)
        along[~own] = end - start
        uv[~own] = start + t[~own, None] * along[~own]
        return uv, along


def _gaps(shape: SampledShape) -> tuple[Ints, Floats]:
    """Faces (g,) and ends (g, 2, 2) of gaps between pcurves that meet at a vertex.

    What is as long as the face is no gap, but the way round a closed surface.
    """
    there = np.flatnonzero([ends[-1] > ends[0] for ends in shape.coedge_breaks])
    forward = shape.coedge_forward[there]
    limits = np.array([shape.coedge_breaks[i][[0, -1]] for i in there.tolist()]).reshape(-1, 2)
    first, last = (shape.on_pcurves(there, limits[:, side])[0] for side in (0, 1))
    ahead = forward[:, None]
    start, end = np.where(ahead, first, last), np.where(ahead, last, first)
    vertices = shape.edges[shape.coedge_edge[there]]
    vertices = np.where(ahead, vertices, vertices[:, ::-1])
    face = shape.coedge_face[there]
    reach = np.array([[u[-1] - u[0], v[-1] - v[0]] for u, v in shape.face_breaks]).reshape(-1, 2)
    starting = defaultdict(list)
    for number, key in enumerate(zip(face.tolist(), vertices[:, 0].tolist(), strict=True)):
        starting[key].append(number)
    faces, gaps = [], []
    for number, key in enumerate(zip(face.tolist(), vertices[:, 1].tolist(), strict=True)):
        near = start[starting[key]] - end[number]
        if key[1] < 0 or not len(near):
            continue
        step = near[np.argmin(np.abs(near / reach[key[0]]).max(axis=1))]
        if step.any() and (np.abs(step) <= _GAP * reach[key[0]]).all():
            faces.append(key[0])
            gaps.append([end[number], end[number] + step])
    return np.array(faces, dtype=np.int64), np.array(gaps).reshape(-1, 2, 2)


def _pieces(shape: SampledShape, lines: _Lines) -> tuple[Ints, Floats]:
    """Lines, and rectangles (n, 2, 2) of a line's parameter and the share of the way along u.

    Lines along u add nothing.
    """
    owners, pieces = [], []
    gaps = [np.array([0.0, 1.0])] * len(lines.gaps)
    for line, breaks in enumerate((*shape.coedge_breaks, *gaps)):
        if breaks[-1] > breaks[0]:
            cells = np.zeros((len(breaks) - 1, 2, 2))
            cells[:, 0, 0], cells[:, 1, 0], cells[:, 1, 1] = breaks[:-1], breaks[1:], 1.0
            owners.append(np.full(len(cells), line))
            pieces.append(cells)
    owner = np.concatenate([np.zeros(0, dtype=np.int64), *owners])
    cells = np.concatenate([np.zeros((0, 2, 2)), *pieces])
    inner = cells[:, 0, 0, None] + [0.25, 0.5, 0.75] * np.diff(cells[:, :, 0], axis=1)
    uv, along = lines.at(np.repeat(owner, 3), inner.ravel())
    low = np.array([u[0] for u, _ in shape.face_breaks])[lines.face[owner]]
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
