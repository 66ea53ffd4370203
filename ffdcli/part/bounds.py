"""The box of a part: of its faces inside their outlines and of its edges, not of their poles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.part.curves import Curve
from ffdcli.part.outlines import Outlines
from ffdcli.part.surfaces import Surface

# Samples of an edge, and of a face in each direction.
_ALONG, _ACROSS = 65, 17
# Samples about the best one, as shares of the step, and how often the step becomes the second.
_AROUND = np.linspace(-1, 1, 9)[[0, 2, 3, 4, 5, 6, 8]]
_ABOUT = np.stack(np.meshgrid(_AROUND, _AROUND), axis=-1).reshape(-1, 2)
_ROUNDS = 20
# What rounding may carry points beyond the bounds, as a share of the size.
_NOISE = 1e-9


def measure_bounds(
    points: Floats,
    curves: tuple[Curve | None, ...],
    ranges: Floats,
    surfaces: tuple[Surface, ...],
    rectangles: Floats,
    outlines: Outlines,
    borders: Sequence[tuple[int, Curve | None, Floats]],
) -> Floats:
    """Lowest and highest coordinates (2, 3) of a part, found by samples that are drawn together.

    Parameters
    ----------
    points, curves, surfaces, rectangles
        As of :class:`~ffdcli.part.record.Part`.
    ranges : (E, 2) float64
        Of the edges.
    outlines : Outlines
    borders : sequence of (int, Curve or None, (2,) float64)
        Face, pcurve and its range, of every coedge. Faces may leave their edges within tolerance.
    """
    found = _Extremes(points)
    for curve, (low, high) in zip(curves, ranges, strict=True):
        if curve is not None:
            found.add_curve(curve, low, high)
    # Planes lie within their edges, except where these leave them within their tolerance.
    noise = _NOISE * float(np.linalg.norm(np.ptp(found.bounds, axis=0)))
    for number, surface in enumerate(surfaces):
        if surface.kind == "plane":
            at = outlines.ends[outlines.starts[number] : outlines.starts[number + 1]]
            outline = surface.points(*at.reshape(-1, 2).T)
            found.include(outline[found.passed(outline, noise)])
    for face, pcurve, (low, high) in borders:
        if pcurve is not None and surfaces[face].kind != "plane":
            border = _Border(surfaces[face], pcurve)
            line = border.points(np.linspace(low, high, _ALONG))
            if found.passed(line, noise).any():
                found.add_curve(border, low, high)
    # All samples come first: few faces then reach the bounds.
    curved = [number for number, surface in enumerate(surfaces) if surface.kind != "plane"]
    grids = [_Grid.of(surfaces[n], rectangles[n], partial(outlines.inside, n)) for n in curved]
    for grid in grids:
        found.include(grid.points[grid.within])
    for grid in grids:
        found.climb(grid)
    return found.bounds


@dataclass(frozen=True, eq=False)
class _Border:
    """The image of a pcurve on its surface."""

    surface: Surface
    pcurve: Curve
    kind = "border"

    def points(self, t: Floats) -> Floats:
        """Points (n, 3) at parameters (n,)."""
        return self.surface.points(*self.pcurve.points(t).T)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Samples of a face: parameters (n, 2), points (n, 3), which are inside, their bend (3,)."""

    surface: Surface
    rectangle: Floats
    inside: Callable[[Floats], Bools]
    at: Floats
    points: Floats
    within: Bools
    bend: Floats

    @classmethod
    def of(cls, surface: Surface, rectangle: Floats, inside: Callable[[Floats], Bools]) -> _Grid:
        """Sample a face."""
        u, v = np.linspace(rectangle[0], rectangle[1], _ACROSS).T
        grid = surface.points(u[:, None], v[None])
        bend = np.abs(np.diff(grid, 2, axis=0)).max(axis=(0, 1))
        bend += np.abs(np.diff(grid, 2, axis=1)).max(axis=(0, 1))
        at = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        return cls(surface, rectangle, inside, at, grid.reshape(-1, 3), inside(at), bend)


class _Extremes:
    """The extreme coordinates so far."""

    def __init__(self, points: Floats) -> None:
        self.bounds = np.full((2, 3), np.inf) * np.array([[1.0], [-1.0]])
        self.include(points)

    def include(self, points: Floats) -> None:
        """Include points."""
        if len(points):
            self.bounds[0] = np.minimum(self.bounds[0], points.min(axis=0))
            self.bounds[1] = np.maximum(self.bounds[1], points.max(axis=0))

    def passed(self, points: Floats, noise: float) -> Bools:
        """(n,) whether points (n, 3) lie outside by more than noise."""
        beyond = np.maximum(self.bounds[0] - points, points - self.bounds[1])
        return np.asarray((beyond > noise).any(axis=1))

    def add_curve(self, curve: Curve | _Border, low: float, high: float) -> None:
        """Include a curve."""
        at = np.linspace(low, high, 2 if curve.kind == "line" else _ALONG)
        line = curve.points(at)
        self.include(line)
        if curve.kind == "line":
            return
        bend = np.abs(np.diff(line, 2, axis=0)).max(axis=0)
        for axis, sign in self._reaching(line, bend):
            for start in _peaks(sign * line[:, axis]):
                best, step = at[start], at[1] - at[0]
                for _ in range(_ROUNDS):
                    near = np.clip(best + step * _AROUND, low, high)
                    points = curve.points(near)
                    self.include(points)
                    best, step = near[np.argmax(sign * points[:, axis])], step * _AROUND[-2]

    def climb(self, grid: _Grid) -> None:
        """Include the highest points inside a face, in the directions where they may count."""
        for axis, sign in self._reaching(grid.points, grid.bend):
            # The highest point may be cut off while another one, lower, is inside.
            heights = sign * grid.points[:, axis]
            starts = [*_ridges(heights), *_ridges(np.where(grid.within, heights, -np.inf))]
            for start in dict.fromkeys(starts):
                best = grid.at[start]
                step = (grid.rectangle[1] - grid.rectangle[0]) / (_ACROSS - 1)
                for _ in range(_ROUNDS):
                    near = np.clip(best + step * _ABOUT, *grid.rectangle)
                    points = grid.surface.points(near[:, 0], near[:, 1])
                    self.include(points[grid.inside(near)])
                    best, step = near[np.argmax(sign * points[:, axis])], step * _AROUND[-2]

    def _reaching(self, points: Floats, bend: Floats) -> list[tuple[int, int]]:
        """Axes and signs of the bounds that points may pass by their bend."""
        over = points.max(axis=0) + bend > self.bounds[1]
        under = points.min(axis=0) - bend < self.bounds[0]
        return [(int(axis), 1) for axis in np.flatnonzero(over)] + [
            (int(axis), -1) for axis in np.flatnonzero(under)
        ]


def _peaks(heights: Floats) -> Ints:
    """Places of values (n,) that are higher than the one before and no lower than the one after.

    A closed curve may have its highest point on either side of its end.
    """
    padded = np.concatenate([[-np.inf], heights, [-np.inf]])
    return np.flatnonzero((heights > padded[:-2]) & (heights >= padded[2:]))


def _ridges(heights: Floats) -> list[int]:
    """Places of peaks among the highest values of the lines of a grid, in either direction."""
    grid = heights.reshape(_ACROSS, _ACROSS)
    across, along = grid.argmax(axis=1), grid.argmax(axis=0)
    rows, columns = _peaks(grid.max(axis=1)), _peaks(grid.max(axis=0))
    return [*(rows * _ACROSS + across[rows]), *(along[columns] * _ACROSS + columns)]
