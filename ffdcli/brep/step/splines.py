"""B-spline curves and surfaces as entities, batch by batch; rational ones as complex instances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Curves, Surfaces
from ffdcli.brep.step.entities import Entities, Field
from ffdcli.brep.step.text import rounded


@dataclass(frozen=True)
class Spline:
    """Splines of one pattern with Cartesian points.

    Parameters
    ----------
    owners : (m,) int64
        Edges or surfaces.
    degrees : tuple of int
        Along each parameter.
    knots : tuple of (m, nb) float64
    mults : tuple of (nb,) int64
    points : (m, n, ..., 2 or 3) float64
    weights : (m, n, ...) float64 or None
    """

    owners: Ints
    degrees: tuple[int, ...]
    knots: tuple[Floats, ...]
    mults: tuple[Ints, ...]
    points: Floats
    weights: Floats | None

    def take(self, rows: Ints) -> Spline:
        """Some of the splines."""
        return replace(
            self,
            owners=self.owners[rows],
            knots=tuple(knots[rows] for knots in self.knots),
            points=self.points[rows],
            weights=None if self.weights is None else self.weights[rows],
        )

    @property
    def closed(self) -> list[Bools]:
        """(m,) whether the first and last points along each parameter are the same."""
        found = []
        for axis in range(1, len(self.degrees) + 1):
            ends = self.points.take(0, axis=axis) == self.points.take(-1, axis=axis)
            found.append(ends.all(axis=tuple(range(1, ends.ndim))))
        return found


@dataclass(frozen=True)
class Lines:
    """Straight edges between planes: edges (m,), starts (m, 3) and unit directions (m, 3)."""

    edges: Ints
    start: Floats
    direction: Floats

    def take(self, rows: Ints) -> Lines:
        """Some of the lines."""
        return Lines(self.edges[rows], self.start[rows], self.direction[rows])


def add_lines(entities: Entities, starts: Ints, directions: Ints, lengths: Floats) -> Ints:
    """Add lines from points along directions: their numbers (m,).

    Lengths (m, 1) are 1 but for rounding.
    """
    vectors = entities.add(b"VECTOR('',#%d,%s)", directions, lengths)
    return entities.add(b"LINE('',#%d,#%d)", starts, vectors)


def spline_curves(batch: Curves, rows: Bools, digits: int) -> Spline:
    """Chosen curves of a batch, with numbers of so many significant digits."""
    points, weights = _divided(batch.poles[rows], digits)
    knots = rounded(batch.knots[rows], digits)
    return Spline(batch.edges[rows], (batch.degree,), (knots,), (batch.mults,), points, weights)


def spline_surfaces(batch: Surfaces, rows: Bools, digits: int) -> Spline:
    """Chosen surfaces of a batch, with numbers of so many significant digits."""
    points, weights = _divided(batch.poles[rows], digits)
    knots = rounded(batch.u_knots[rows], digits), rounded(batch.v_knots[rows], digits)
    mults = batch.u_mults, batch.v_mults
    return Spline(batch.surfaces[rows], batch.degrees, knots, mults, points, weights)


def _divided(poles: Floats, digits: int) -> tuple[Floats, Floats | None]:
    """Cartesian points and weights of homogeneous poles."""
    if poles.shape[-1] == 3:
        return rounded(poles, digits), None
    return rounded(poles[..., :3] / poles[..., 3:], digits), rounded(poles[..., 3], digits)


def add_curves(entities: Entities, spline: Spline, points: Ints) -> Ints:
    """Add curves whose points have these numbers (m, n): their numbers (m,)."""
    poles = _list("#%d", points.shape[1])
    knots = f"({_commas(spline.mults[0])}),(%s),.{_kind(spline)}."
    fields: list[Field] = [points, *spline.closed, *spline.knots]
    shape = f"{spline.degrees[0]},{poles},.UNSPECIFIED.,.%s.,.F."
    if spline.weights is None:
        return entities.add(f"B_SPLINE_CURVE_WITH_KNOTS('',{shape},{knots})".encode(), *fields)
    template = (
        f"(BOUNDED_CURVE()B_SPLINE_CURVE({shape})B_SPLINE_CURVE_WITH_KNOTS({knots})CURVE()"
        "GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_CURVE((%s))REPRESENTATION_ITEM(''))"
    )
    return entities.add(template.encode(), *fields, spline.weights)


def add_surfaces(entities: Entities, spline: Spline, points: Ints) -> Ints:
    """Add surfaces whose points have these numbers (m, nu, nv): their numbers (m,)."""
    count, size_u, size_v = points.shape
    poles = _list(_list("#%d", size_v), size_u)
    u_mults, v_mults = map(_commas, spline.mults)
    knots = f"({u_mults}),({v_mults}),(%s),(%s),.{_kind(spline)}."
    fields: list[Field] = [points.reshape(count, -1), *spline.closed, *spline.knots]
    shape = f"{_commas(spline.degrees)},{poles},.UNSPECIFIED.,.%s.,.%s.,.F."
    if spline.weights is None:
        return entities.add(f"B_SPLINE_SURFACE_WITH_KNOTS('',{shape},{knots})".encode(), *fields)
    weights = _list("(%s)", size_u)
    template = (
        f"(BOUNDED_SURFACE()B_SPLINE_SURFACE({shape})B_SPLINE_SURFACE_WITH_KNOTS({knots})"
        f"GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE({weights})"
        "REPRESENTATION_ITEM('')SURFACE())"
    )
    return entities.add(template.encode(), *fields, spline.weights)


def _list(item: str, count: int) -> str:
    return f"({','.join([item] * count)})"


def _commas(values: Sequence[int] | Ints) -> str:
    return ",".join(str(int(value)) for value in values)


def _kind(spline: Spline) -> str:
    """What STEP calls the knots: those of joined Bézier pieces have a name."""
    pairs = zip(spline.mults, spline.degrees, strict=True)
    pieces = all((mults[1:-1] == degree).all() for mults, degree in pairs)
    return "PIECEWISE_BEZIER_KNOTS" if pieces else "UNSPECIFIED"


def check_ranges(spline: Spline) -> str:
    """What is wrong with the numbers of splines; empty if nothing is."""
    if not np.isfinite(spline.points).all():
        return "a control point is not finite"
    if spline.weights is not None and not (spline.weights > 0).all():
        return "a weight is not positive"
    if any((np.diff(knots, axis=1) <= 0).any() for knots in spline.knots):
        return "knots do not rise"
    return ""
