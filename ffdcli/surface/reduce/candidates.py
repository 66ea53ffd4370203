"""Candidate spline spaces along one direction: lower degrees, fewer or more knots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.spline_spaces import Grid, Space, bezier_points, chebyshev_grid

# Numbers of kept knots, and of equal parts of spans, that are tried.
_STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
# Largest number of parts of a span, and of spans of one direction, that is tried.
_MOST_PARTS = 64
_MOST_SPANS = 512


class Level(NamedTuple):
    """One candidate space.

    Parameters
    ----------
    degree : int
    kept : int
        Inner knots of the source that are kept.
    parts : int
        Equal parts into which every span is divided.
    exact : bool
        True for the source space itself.
    """

    degree: int
    kept: int
    parts: int = 1
    exact: bool = False


@dataclass(frozen=True)
class Direction:
    """One parameter direction of patches that share degree and multiplicities.

    Parameters
    ----------
    degree : int
    knots : (m, nb) float64
        Distinct knots, not normalised.
    mults : (nb,) int64
    order : (m, nb - 2) int64
        Inner knots, the most needed first.
    """

    degree: int
    knots: Floats
    mults: Ints
    order: Ints

    @property
    def source(self) -> Space:
        """The space of the patches, over [0, 1]."""
        return Space(self.degree, _unit(self.knots), self.mults)

    @property
    def spans(self) -> int:
        """Number of polynomial pieces."""
        return self.knots.shape[1] - 1

    def take(self, rows: Ints) -> Direction:
        """The direction of the chosen patches alone."""
        return Direction(self.degree, self.knots[rows], self.mults, self.order[rows])

    def levels(self, max_degree: int | None) -> list[list[Level]]:
        """Lists of levels, one for each degree, each from the smallest space up.

        Only spaces smaller than the source are listed, unless the degree of the source is too high.
        CAD kernels want C1 inside a face, so inner knots need at least degree 2.
        """
        highest = self.degree if max_degree is None else min(self.degree, max_degree)
        refined = highest < self.degree
        inner = self.spans - 1
        size = int(self.mults.sum()) - self.degree - 1
        ladders = []
        for degree in range(1, highest + 1):
            counts = [0]
            if degree > 1:
                counts += [k for k in _STEPS if k < inner] + [inner] * (inner > 0)
            kept = [
                Level(degree, k)
                for k in counts
                if refined or degree + 1 + k * self._mult(degree) < size
            ]
            if refined and degree == highest:
                most = min(_MOST_PARTS, max(_MOST_SPANS // self.spans, 2))
                kept += [Level(degree, inner, r) for r in _STEPS if 1 < r <= most]
            ladders.append(kept)
        if not refined:
            ladders.append([Level(self.degree, inner, exact=True)])
        return [ladder for ladder in ladders if ladder]

    def _mult(self, degree: int) -> int:
        """Multiplicity of kept knots: the least continuity of the source that the degree allows."""
        return degree - min(self.degree - int(self.mults[1:-1].max(initial=1)), degree - 1)

    def knots_of(self, level: Level) -> tuple[Floats, Ints]:
        """Distinct knots (m, nb) and multiplicities (nb,) of a level, not normalised."""
        degree, knots = level.degree, self.knots
        if level.exact:
            return knots, self.mults
        if level.parts > 1:
            own = degree - np.minimum(self.degree - self.mults[1:-1], degree - 1)
            share = np.arange(level.parts) / level.parts
            fine = knots[:, :-1, None] + np.diff(knots, axis=1)[:, :, None] * share
            knots = np.concatenate([fine.reshape(len(knots), -1), knots[:, -1:]], axis=1)
            inner = np.ones(knots.shape[1] - 2, dtype=np.int64)
            inner[level.parts - 1 :: level.parts] = own
        else:
            which = np.sort(self.order[:, : level.kept], axis=1)
            inside = np.take_along_axis(knots, which, axis=1)
            knots = np.concatenate([knots[:, :1], inside, knots[:, -1:]], axis=1)
            inner = np.full(level.kept, self._mult(degree) if level.kept else 1)
        return knots, np.concatenate([[degree + 1], inner, [degree + 1]]).astype(np.int64)

    def target(self, level: Level) -> Space:
        """The space of a level over [0, 1]."""
        knots, mults = self.knots_of(level)
        if self.spans == 1:
            # The bound allows for the rounding of knots within a single span.
            return Space(level.degree, np.linspace(0.0, 1.0, knots.shape[1])[None], mults)
        return Space(level.degree, _unit(knots), mults)

    def grid(self, level: Level) -> Grid:
        """Cells in which source and target are polynomials, with the source space on them."""
        cells = self.target(level).knots if level.parts > 1 else self.source.knots
        return chebyshev_grid(self.source, cells)


def make_direction(degree: int, knots: Floats, mults: Ints, poles: Floats) -> Direction:
    """The direction of patches along which they have control points (m, n, ...)."""
    source = Space(degree, _unit(knots), mults)
    return Direction(degree, knots, mults, _by_need(source, poles))


def _unit(knots: Floats) -> Floats:
    """Knots (m, nb) over [0, 1]; a single row for all patches where there is one span."""
    if knots.shape[1] == 2:
        return np.array([[0.0, 1.0]])
    scaled: Floats = (knots - knots[:, :1]) / (knots[:, -1:] - knots[:, :1])
    scaled[:, -1] = 1.0
    return scaled


def _by_need(space: Space, poles: Floats) -> Ints:
    """(m, nb - 2) inner knots, the most needed first.

    Removing a knot costs about the jumps of the derivatives there, times powers of the shorter
    span beside it. Only the order matters, since every fit is certified.
    """
    inner = space.knots.shape[1] - 2
    if inner == 0:
        return np.zeros((len(poles), 0), dtype=np.int64)
    m, p = len(poles), space.degree
    points = bezier_points(space, space.knots)
    pieces = (
        points.reshape(len(points), -1, space.size) @ poles.reshape(m, space.size, -1)
    ).reshape(m, inner + 1, p + 1, -1)
    lengths = np.diff(space.knots, axis=1)
    short = np.minimum(lengths[:, 1:], lengths[:, :-1])
    need = np.zeros((m, inner))
    for k in range(1, p + 1):
        steps = np.diff(pieces, n=k, axis=2)
        # Taylor terms of order k of both polynomials, over the shorter span.
        before = steps[:, :-1, -1] * ((short / lengths[:, :-1]) ** k)[:, :, None]
        after = steps[:, 1:, 0] * ((short / lengths[:, 1:]) ** k)[:, :, None]
        scale = float(np.prod(np.arange(p, p - k, -1)) / np.prod(np.arange(1, k + 1)))
        need = np.maximum(need, scale * np.abs(after - before).max(axis=2))
    return np.argsort(-need, axis=1, kind="stable") + 1
