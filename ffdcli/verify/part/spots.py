"""Sample points inside the outlines of faces, and along lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.trim import expand
from ffdcli.verify.part.shape import DeformedShape

# Points across a face at least and at most, and those of the first look at it.
LEAST, MOST, LOOK = 4, 128, 8
# Points on every line at least, and on each of its pieces. Not at quarters, where circles and
# their rational forms agree.
LINE_POINTS, PIECE_POINTS = 8, 3
# Most points in the pieces between breaks.
PIECES = 200_000


@dataclass(frozen=True, eq=False)
class Spots:
    """Points of faces or lines.

    Parameters
    ----------
    owner : (n,) int64
        Their faces or lines.
    params : (n, k) float64
    position : (n, 3) float64, model length
        Deformed.
    tangents : (n, k, 3) float64
    """

    owner: Ints
    params: Floats
    position: Floats
    tangents: Floats

    def take(self, which: Ints) -> Spots:
        """Some of the spots."""
        return Spots(
            self.owner[which], self.params[which], self.position[which], self.tangents[which]
        )


def face_spots(image: DeformedShape, wanted: int) -> Spots:
    """Spread about ``wanted`` points over all faces by area, and four on each polynomial piece.

    A wrong control point changes few pieces only. Every face gets some points if a grid of
    ``MOST`` by ``MOST`` finds any inside its outline.
    """
    shape, random = image.shape, np.random.default_rng(0)
    ends = np.array([[[axis[0], axis[-1]] for axis in pair] for pair in shape.face_breaks])
    ends = ends.reshape(-1, 2, 2)
    count = len(ends)
    every = np.arange(count)
    face, uv = _grid(every, np.full((count, 2), LOOK), ends, random)
    _, sides = image.on_faces(face, uv)
    number = LOOK * LOOK
    steps = np.linalg.norm(sides, axis=2) * (ends[face, :, 1] - ends[face, :, 0])
    lengths = np.maximum(sums(face, steps, count) / number, np.finfo(float).tiny)
    area = lengths.prod(axis=1)
    inner = np.bincount(face[shape.inside(face, uv)], minlength=count) / number
    filled = np.maximum(inner, 1 / number)
    cells = wanted * area / max((area * filled).sum(), np.finfo(float).tiny)
    slim = np.sqrt(lengths[:, :1] / lengths[:, 1:]) ** [1, -1]
    levels = np.clip(np.ceil(np.sqrt(cells)[:, None] * slim), LEAST, MOST).astype(np.int64)
    found = [_inside(image, *_grid(every, levels, ends, random))]
    found.append(_inside(image, *_on_pieces(image, random)))
    bare = np.setdiff1d(every, np.concatenate([each[0] for each in found]))
    level = 2 * LOOK
    while len(bare) and level <= MOST:
        found.append(_inside(image, *_grid(bare, np.full((len(bare), 2), level), ends, random)))
        bare, level = np.setdiff1d(bare, found[-1][0]), 2 * level
    owner, params = (np.concatenate(each) for each in zip(*found, strict=True))
    return Spots(owner, params, *image.on_faces(owner, params))


def line_spots(image: DeformedShape) -> Spots:
    """Points on every line: its ends, others between, and some on each of its pieces."""
    owners, params = [], []
    spaced = np.linspace(0, 1, LINE_POINTS)
    inner = (np.arange(PIECE_POINTS) + 0.5) / PIECE_POINTS
    for line in np.flatnonzero(image.line_there):
        breaks = image.line_breaks[line]
        at = breaks[0] + spaced * (breaks[-1] - breaks[0])
        if len(breaks) > 2:
            more = breaks[:-1, None] + inner * np.diff(breaks)[:, None]
            at = np.concatenate([at, more.ravel()])
        # Not a rounding beyond the end.
        params.append(np.clip(at, breaks[0], breaks[-1]))
        owners.append(np.full(len(at), line))
    owner = np.concatenate([np.zeros(0, dtype=np.int64), *owners])
    at = np.concatenate([np.zeros(0), *params])[:, None]
    return Spots(owner, at, *image.on_lines(owner, at))


def _grid(
    face: Ints, levels: Ints, ends: Floats, random: np.random.Generator
) -> tuple[Ints, Floats]:
    """Faces and parameters of a point in each cell of grids over the rectangles of faces (m,)."""
    row, place = expand(levels.prod(axis=1))
    cell = np.stack([place // levels[row, 1], place % levels[row, 1]], axis=1)
    share = (cell + random.random(cell.shape)) / levels[row]
    low, high = ends[face[row], :, 0], ends[face[row], :, 1]
    return face[row], low + share * (high - low)


def _on_pieces(image: DeformedShape, random: np.random.Generator) -> tuple[Ints, Floats]:
    """Four points on every piece between breaks of the faces, fewer where there are too many."""
    owners, params = [], []
    for face, (u, v) in enumerate(image.shape.face_breaks):
        if len(u) + len(v) == 4:
            continue
        u, v = (_twice(axis) for axis in (u, v))
        grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        owners.append(np.full(len(grid), face))
        params.append(grid)
    owner = np.concatenate([np.zeros(0, dtype=np.int64), *owners])
    uv = np.concatenate([np.zeros((0, 2)), *params])
    if len(owner) > PIECES:
        some = np.sort(random.choice(len(owner), PIECES, replace=False))
        owner, uv = owner[some], uv[some]
    return owner, uv


def _twice(breaks: Floats) -> Floats:
    """Two values in each interval."""
    values: Floats = (breaks[:-1, None] + np.diff(breaks)[:, None] * [0.25, 0.75]).ravel()
    return values


def _inside(image: DeformedShape, face: Ints, uv: Floats) -> tuple[Ints, Floats]:
    inside = image.shape.inside(face, uv)
    return face[inside], uv[inside]
