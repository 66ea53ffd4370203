"""Subdivision search: halve boxes until the sign of det J is proved on all of them.

A polynomial in Bernstein form lies in the hull of its coefficients, and its corner coefficients are
values of it. A box is settled when all its coefficients are well above zero. Others are halved
until they are settled or lie outside the model, a point of the model with a negative determinant is
found, or the budget is spent. All boxes of a round are treated at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.folds.determinant import Determinants, concatenate
from ffdcli.folds.domain import SearchDomain, in_model, repeat_pairs

# Coefficients of halved boxes after which the search ends without a proof; and after which it ends
# with a loose bound, where the sign is proved.
_BUDGET = 6_000_000
_POLISH = 1_000_000
# Share of a box's width by which a corner is moved inwards.
_NUDGE = 1e-6
# Points of the surface tried in one round.
_MOST_TRIES = 500


@dataclass(frozen=True)
class Search:
    """Result of the search.

    Parameters
    ----------
    bound : float
        Lower bound of the determinants in the domain; not meaningful where a negative one was
        found.
    at : (3 or 4,) float64 or None
        A point of the domain with a negative determinant, beyond rounding.
    value : float or None
        The determinant there; on a knot plane of continuity C0, the one on one side.
    spent : int
        Coefficients of halved boxes.
    """

    bound: float
    at: Floats | None = None
    value: float | None = None
    spent: int = 0


@dataclass(frozen=True)
class _Boxes:
    """Undecided boxes and their position relative to the model.

    Parameters
    ----------
    forms : Determinants
    deep : (m,) bool
        Boxes known to lie wholly in the model.
    pairs : (n, 2) int64 or None
        Pairs of box and triangle that may meet, sorted by box; None where not computed yet.
    """

    forms: Determinants
    deep: Bools
    pairs: Ints | None

    def take(self, chosen: Ints) -> _Boxes:
        """The chosen boxes, in the given order; boxes may be repeated."""
        pairs = self.pairs
        if pairs is not None:
            pairs = repeat_pairs(pairs, self.forms.count, chosen)
        return _Boxes(self.forms.take(chosen), self.deep[chosen], pairs)

    def split(self) -> _Boxes:
        """All boxes halved."""
        forms, parents = self.forms.split()
        related = self.take(parents)
        return _Boxes(forms, related.deep, related.pairs)


def prove_positive(
    blocks: Iterable[Determinants], domain: SearchDomain, seen: float, *, share: float
) -> Search:
    """Prove that determinants are positive all over a domain, or find a negative one.

    Parameters
    ----------
    blocks : iterable of Determinants
        Forms on cells that cover the domain, or its undecided part.
    domain : SearchDomain
    seen : float
        The least determinant at sample points of the domain.
    share : float
        A box is settled where its bound is positive and at least this share of the least sampled
        value; with 0 the sign suffices.
    """
    bound, kept = np.inf, []
    for block in blocks:
        lower = block.lower_bounds()
        good = _settled(lower, seen, share)
        bound = min(bound, float(lower[good].min(initial=np.inf)))
        kept.append(block.take(~good))
    if not kept:
        return Search(np.inf)
    forms = concatenate(kept)
    boxes = _Boxes(forms, np.zeros(forms.count, dtype=bool), None)
    spent = 0
    while boxes.forms.count:
        boxes = _in_model(boxes, domain)
        points, values, slack, owners = _tries(boxes, domain)
        if np.any(values < -slack):
            least = int(np.argmin(values + slack))
            found = _negative(boxes, points[least], float(values[least]), int(owners[least]))
            return replace(found, spent=spent)
        seen = min(seen, float(values.min(initial=np.inf)))
        lower = boxes.forms.lower_bounds()
        good = _settled(lower, seen, share)
        bound = min(bound, float(lower[good].min(initial=np.inf)))
        boxes, lower = boxes.take(np.flatnonzero(~good)), lower[~good]
        spent += 2 * boxes.forms.forms.size
        enough = _POLISH if np.all(lower > 0) else _BUDGET
        if seen <= 0 or spent > enough:
            return Search(min(bound, float(lower.min(initial=np.inf))), spent=spent)
        if boxes.forms.count:
            boxes = boxes.split()
    return Search(bound, spent=spent)


def _settled(lower: Floats, seen: float, share: float) -> Bools:
    return np.asarray((lower > 0) & (lower >= share * seen if share else True))


def _in_model(boxes: _Boxes, domain: SearchDomain) -> _Boxes:
    """The boxes that meet the model."""
    forms = boxes.forms
    kept, deep, pairs = in_model(
        domain, forms.low[:, :3], forms.high[:, :3], boxes.deep, boxes.pairs
    )
    return _Boxes(forms, deep, pairs).take(np.flatnonzero(kept))


def _tries(boxes: _Boxes, domain: SearchDomain) -> tuple[Floats, Floats, Floats, Ints]:
    """Points of the model in the boxes, their determinants, rounding errors and boxes."""
    forms = boxes.forms
    deep = np.flatnonzero(boxes.deep)
    points, values, slack = forms.corner_values(deep)
    owners = np.resize(deep, len(points))
    if boxes.pairs is None or not len(boxes.pairs):
        return points, values, slack, owners
    pairs = boxes.pairs[:: -(-len(boxes.pairs) // _MOST_TRIES)]
    owner = pairs[:, 0]
    middle = (forms.low + forms.high)[owner] / 2
    # Folds grow with the scale s, so the upper end of its interval is tried.
    near = np.column_stack([domain.nearest(pairs, middle[:, :3]), forms.high[owner, 3:]])
    within = np.all((near >= forms.low[owner]) & (near <= forms.high[owner]), axis=1)
    owner, near = owner[within], near[within]
    found, doubt = forms.values(owner, near)
    return (
        np.concatenate([points, near]),
        np.concatenate([values, found]),
        np.concatenate([slack, doubt]),
        np.concatenate([owners, owner]),
    )


def _negative(boxes: _Boxes, point: Floats, value: float, owner: int) -> Search:
    """The result at a negative point; a corner is moved into its box where that keeps the sign.

    On a knot plane of continuity C0 the determinants of the two sides differ.
    """
    forms = boxes.forms
    if boxes.deep[owner]:
        middle = (forms.low[owner] + forms.high[owner]) / 2
        within = point + _NUDGE * (middle - point)
        (found,), (doubt,) = forms.values(np.array([owner]), within[None])
        if found < -doubt:
            return Search(-np.inf, within, float(found))
    return Search(-np.inf, point, value)
