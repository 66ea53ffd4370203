"""Jacobian determinants of polynomial cells as Bernstein forms, with bounds of their rounding.

With weights 1, ``det J = det [D_u, D_v, D_w]``, a polynomial of degree ``3k - 1`` per axis. With
weights and ``H = (W, W D)``, ``det [H, H_u, H_v, H_w] = W^4 det J``, of degree ``4k - 1``. Where
the lattice depends on a further variable s, the forms have s as a fourth one.

With ``W^4`` written in the same degree, with coefficients q_i > 0, det J is a mean of the quotients
of coefficients: of ``f_i / q_i`` with weights ``q_i B_i``. So uneven weights do not loosen the
bound on cells at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.splines.polynomials import (
    add_product,
    derivative,
    halve,
    raise_degree,
    scale,
    unscale,
    values_at,
)
from ffdcli.volume.protocol import Volume

_EPS = float(np.finfo(float).eps)
# Upper bound of the roundings in one weight of a restriction, per degree: three differences, a
# quotient, two products and a sum in each step.
_WEIGHT_ROUNDINGS = 8
# Upper bound of the roundings in completing forms of displacements, relative to the largest.
_COMPLETED = 16.0


@dataclass(frozen=True)
class Determinants:
    """Bernstein forms of ``det J`` (times ``W^4`` where there are weights) on m boxes.

    Parameters
    ----------
    low, high : (m, 3 or 4) float64
        The boxes, in the lattice frame; the fourth coordinate is s.
    forms : (..., m) float64
        Coefficients, u, v, w and, if there is one, s.
    slack : (m,) float64
        Bound of the rounding in any coefficient.
    powers : (..., m) float64 or None
        Bernstein form of ``W^4``, as ``forms``; None where all weights are 1.
    power_slack : (m,) float64
        Bound of the relative rounding in any coefficient of ``powers``.
    """

    low: Floats
    high: Floats
    forms: Floats
    slack: Floats
    powers: Floats | None
    power_slack: Floats

    @property
    def count(self) -> int:
        """Number of boxes."""
        return len(self.low)

    @property
    def size(self) -> int:
        """Number of coefficients per box."""
        return int(np.prod(self.forms.shape[:-1]))

    def lower_bounds(self) -> Floats:
        """(m,) lower bounds of det J on each box, from the hull of the coefficients."""
        if self.powers is None:
            return _over_all(np.min, self.forms) - self.slack
        # Nothing is known where rounding alone may make a coefficient of W vanish.
        sure = self.power_slack < 1
        powers = np.where(sure, self.powers, 1.0)
        least = _over_all(np.min, (self.forms - self.slack) / powers)
        below = least - np.abs(least) * np.where(sure, self.power_slack, 0.0)
        return np.where(sure, below, -np.inf)

    def values(self, boxes: Ints, points: Floats) -> tuple[Floats, Floats]:
        """det J and its rounding bounds (n,) at points (n, 3 or 4) of the given boxes (n,)."""
        shares = (points - self.low[boxes]) / (self.high - self.low)[boxes]
        found, slack = values_at(self.forms[..., boxes], shares), self.slack[boxes]
        if self.powers is None:
            return found, slack
        weight = values_at(self.powers[..., boxes], shares)
        return found / weight, slack / weight

    def corner_values(self, boxes: Ints) -> tuple[Floats, Floats, Floats]:
        """Corners (n, 3 or 4) of the given boxes, det J there and its rounding bounds (n,)."""
        dimension = self.low.shape[1]
        ends = np.stack([self.low, self.high])
        points, values, slack = [], [], []
        for corner in product((0, -1), repeat=dimension):
            found, doubt = self.forms[corner][boxes], self.slack[boxes]
            if self.powers is not None:
                weight = self.powers[corner][boxes]
                found, doubt = found / weight, doubt / weight
            points.append(ends[np.array(corner)[None], boxes[:, None], np.arange(dimension)])
            values.append(found)
            slack.append(doubt)
        return np.concatenate(points), np.concatenate(values), np.concatenate(slack)

    def take(self, chosen: Bools | Ints) -> Determinants:
        """The chosen boxes."""
        powers = None if self.powers is None else self.powers[..., chosen]
        return Determinants(
            self.low[chosen],
            self.high[chosen],
            self.forms[..., chosen],
            self.slack[chosen],
            powers,
            self.power_slack[chosen],
        )

    def turned(self, sense: int) -> Determinants:
        """The forms of ``sense * det J``."""
        return self if sense > 0 else replace(self, forms=-self.forms)

    def split(self) -> tuple[Determinants, Ints]:
        """Halve every box across the direction in which its form varies most.

        Returns
        -------
        Determinants
        (2 m,) int64
            Number of the box that each half comes from.
        """
        dimension = self.low.shape[1]
        steps = [_over_all(np.max, np.abs(np.diff(self.forms, axis=a))) for a in range(dimension)]
        along = np.argmax(np.stack(steps), axis=0)
        parts, parents = [], []
        for axis in np.unique(along).tolist():
            chosen = np.flatnonzero(along == axis)
            parts += self.take(chosen)._halves(axis)
            parents += [chosen, chosen]
        return concatenate(parts), np.concatenate(parents)

    def _halves(self, axis: int) -> list[Determinants]:
        middle = (self.low[:, axis] + self.high[:, axis]) / 2
        low, high = self.low.copy(), self.high.copy()
        low[:, axis], high[:, axis] = middle, middle
        # A coefficient of a half is a mean of `degree + 1` others.
        largest = _over_all(np.max, np.abs(self.forms))
        slack = self.slack + (self.forms.shape[axis] + 1) * _EPS * largest
        lower, upper = halve(self.forms, axis)
        powers = (None, None) if self.powers is None else halve(self.powers, axis)
        share = self.power_slack + (self.forms.shape[axis] + 1) * _EPS
        return [
            Determinants(self.low, high, lower, slack, powers[0], share),
            Determinants(low, self.high, upper, slack, powers[1], share),
        ]


def concatenate(parts: Sequence[Determinants]) -> Determinants:
    """The boxes of several records in one."""
    powers = [part.powers for part in parts if part.powers is not None]
    return Determinants(
        np.concatenate([part.low for part in parts]),
        np.concatenate([part.high for part in parts]),
        np.concatenate([part.forms for part in parts], axis=-1),
        np.concatenate([part.slack for part in parts]),
        np.concatenate(powers, axis=-1) if powers else None,
        np.concatenate([part.power_slack for part in parts]),
    )


def find_cells(volume: Volume, low: Floats, high: Floats) -> Ints:
    """(m, 3) polynomial cells that meet the box from ``low`` to ``high`` (3,), each once.

    The box is cut at faces of the cells at the centres of its parts until every part lies in one
    cell. The number of rounds is the depth of the octree; no grid of all knots is needed.
    """
    low, high = low[None, :], high[None, :]
    found = []
    while len(low):
        cells = volume.cells((low + high) / 2)
        bounds = volume.cell_bounds(cells)
        ends = low[:, None], high[:, None]
        beyond = (bounds > ends[0]) & (bounds < ends[1])
        whole = ~beyond.any(axis=(1, 2))
        found.append(cells[whole])
        low, high, bounds = low[~whole], high[~whole], bounds[~whole]
        rows = np.arange(len(low))
        side, axis = np.divmod(np.argmax(beyond[~whole].reshape(-1, 6), axis=1), 3)
        at = bounds[rows, side, axis]
        first, last = high.copy(), low.copy()
        first[rows, axis], last[rows, axis] = at, at
        low, high = np.concatenate([low, last]), np.concatenate([first, high])
    return np.unique(np.concatenate(found), axis=0)


def cell_forms(volume: Volume, cells: Ints, nets: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Bernstein forms of the (homogeneous) volume on whole cells, for one or more control nets.

    Parameters
    ----------
    cells : (m, 3) int64
    nets : control nets, shaped as ``volume.net``
        Several are the Bernstein coefficients of a net that depends on s.

    Returns
    -------
    forms : (3 or 4, ku + 1, kv + 1, kw + 1, [number of nets,] m) float64
        Components ``x, y, z``, or ``W, W x, W y, W z``.
    rounding : (c,) float64
        Bound of the rounding in the coefficients of each component.
    """
    bounds = volume.cell_bounds(cells)
    restriction = volume.restrict(cells, bounds[:, 0], bounds[:, 1])
    kind = volume.net_kind
    corners = _corners(bounds) if kind.displaces else bounds
    found = [kind.complete(restriction.apply(net), corners) for net in nets]
    each = [np.moveaxis(form, (0, -1), (-1, 0)) for form in found]
    forms = each[0] if len(nets) == 1 else np.stack(each, axis=-2)
    if kind.displaces:
        # The places added to displacements are as large as the box, times the largest weight.
        inner = tuple(range(1, forms.ndim))
        reach = np.abs(volume.box).max() * (np.abs(forms[-1]).max() if len(forms) == 4 else 1.0)
        largest = _COMPLETED * (np.abs(forms).max(axis=inner, initial=0.0) + reach)
    else:
        rows = [np.abs(net.reshape(-1, net.shape[-1])).max(axis=0) for net in nets]
        largest = np.max(rows, axis=0)
    if len(forms) == 4:
        forms, largest = forms[[3, 0, 1, 2]], largest[[3, 0, 1, 2]]
    roundings = sum(_WEIGHT_ROUNDINGS * degree + degree + 1 for degree in volume.degrees)
    return np.ascontiguousarray(forms), roundings * _EPS * largest


def _corners(bounds: Floats) -> Floats:
    """(m, 2, 2, 2, 3) corners of boxes (m, 2, 3), indexed by end along u, v, w."""
    end = np.indices((2, 2, 2)).reshape(3, -1).T
    return bounds[:, end, np.arange(3)].reshape(-1, 2, 2, 2, 3)


def cell_determinants(
    volume: Volume, cells: Ints, nets: Sequence[Floats], interval: Sequence[float] = ()
) -> Determinants:
    """Forms of det J on whole cells.

    Parameters
    ----------
    cells : (m, 3) int64
    nets : control nets, shaped as ``volume.net``
        One, or the Bernstein coefficients of a net that depends on s.
    interval : (float, float), optional
        The interval of s.
    """
    forms, rounding = cell_forms(volume, cells, nets)
    columns = [derivative(forms, axis) for axis in (1, 2, 3)]
    errors = [2 * degree * rounding for degree in volume.degrees]
    powers, share = None, np.zeros(len(cells))
    if len(forms) == 4:
        powers, share = _fourth_power(forms[0], float(rounding[0]))
        columns.insert(0, forms)
        errors.insert(0, rounding)
    forms, slack = _determinant(columns, errors)
    if powers is not None:
        forms = scale(forms)
        for axis in range(forms.ndim - 1):
            while forms.shape[axis] < powers.shape[axis]:
                forms = raise_degree(forms, axis)
        forms = unscale(forms)
        # Coefficients of the raised form are means of two or three, in up to four steps.
        slack = slack + 16 * _EPS * _over_all(np.max, np.abs(forms))
    bounds = volume.cell_bounds(cells)
    content = np.prod(bounds[:, 1] - bounds[:, 0], axis=1)
    low, high = bounds[:, 0], bounds[:, 1]
    if len(nets) > 1:
        low = np.column_stack([low, np.full(len(low), interval[0])])
        high = np.column_stack([high, np.full(len(high), interval[1])])
    return Determinants(low, high, forms / content, slack / content, powers, share)


def _fourth_power(weights: Floats, rounding: float) -> tuple[Floats, Floats]:
    """Form (..., m) of the fourth power, and bounds (m,) of its relative rounding.

    Coefficients are sums of positive terms, so rounding errors stay relative.
    """
    once = scale(weights)
    square = np.zeros((*(2 * n - 1 for n in once.shape[:-1]), once.shape[-1]))
    add_product(square, once, once, 1)
    power = np.zeros((*(2 * n - 1 for n in square.shape[:-1]), once.shape[-1]))
    add_product(power, square, square, 1)
    terms = int(np.prod(once.shape[:-1])) + int(np.prod(square.shape[:-1]))
    least = _over_all(np.min, weights)
    positive = least > 16 * rounding
    share = 8 * rounding / np.where(positive, least, 1.0) + 4 * (terms + 8) * _EPS
    return unscale(power), np.where(positive, share, np.inf)


def _determinant(columns: list[Floats], errors: list[Floats]) -> tuple[Floats, Floats]:
    """Determinants of matrices of forms, expanded along one column after another.

    Parameters
    ----------
    columns : n float64 arrays (n, ..., m)
    errors : n float64 arrays (n,)
        Bounds of the rounding in each component's coefficients.

    Returns
    -------
    (..., m), (m,) float64
        The form, and a bound of the rounding in its coefficients.
    """
    boxes = columns[0].shape[-1]
    scaled = [np.stack([scale(form) for form in column]) for column in columns]
    minors: dict[tuple[int, ...], Floats] = {(row,): form for row, form in enumerate(scaled[-1])}
    roundings = 0
    for column in scaled[-2::-1]:
        size = len(next(iter(minors))) + 1
        before = next(iter(minors.values())).shape[:-1]
        shape = tuple(a + b - 1 for a, b in zip(column.shape[1:-1], before, strict=True))
        grown = {}
        for rows in combinations(range(len(column)), size):
            out = np.zeros((*shape, boxes))
            for place, row in enumerate(rows):
                rest = rows[:place] + rows[place + 1 :]
                add_product(out, column[row], minors[rest], -1 if place % 2 else 1)
            grown[rows] = out
        minors = grown
        # A coefficient is a sum of at most as many terms as the smaller factor has, per row.
        roundings += size * min(int(np.prod(column.shape[1:-1])), int(np.prod(before))) + 2
    (whole,) = minors.values()
    # Every coefficient is a mean of products of coefficients, each bounded by these.
    largest = np.stack(
        [_over_all(np.max, np.abs(column), keep=1).sum(axis=0) for column in columns]
    )
    grown_by = np.stack([np.full(boxes, error.sum()) for error in errors])
    bound = np.prod(largest + grown_by, axis=0)
    slack = bound - np.prod(largest, axis=0) + 2 * (roundings + 8) * _EPS * bound
    return unscale(whole), slack


def _over_all(function: Callable[..., Floats], forms: Floats, keep: int = 0) -> Floats:
    """A minimum or maximum over all axes but the first ``keep`` and the last."""
    return function(forms, axis=tuple(range(keep, forms.ndim - 1)))
