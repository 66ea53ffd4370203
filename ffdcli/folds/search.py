"""The search behind the certificate: halve boxes until the sign of det J is proved on all of them.

A polynomial in Bernstein form lies in the hull of its coefficients, and the corner ones are values
of it. Boxes whose coefficients are all well above zero are settled; the others are halved until
they are, or have left the model, or a point of the model with a negative determinant turns up, or
the budget is spent. All boxes of a round are treated at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.folds.determinant import Determinants, concatenate
from ffdcli.folds.domain import Domain, in_model, repeat_pairs

# Coefficients of halved boxes after which the search is given up; and after which, where the sign
# is proved and only the bound is loose, the bound is taken as it is.
_BUDGET = 6_000_000
_POLISH = 1_000_000
# Share of a box's width.
_NUDGE = 1e-6
# Points of the surface tried in one round.
_MOST_TRIES = 500


@dataclass(frozen=True)
class Search:
    """What the search came to.

    Parameters
    ----------
    bound : float
        The determinants are nowhere in the domain less than this; means nothing where a negative
        one was found.
    at : (3 or 4,) float64 or None
        A point of the domain with a negative determinant, beyond rounding.
    value : float or None
        The determinant there; on a knot plane across which the volume is only C0, on one side.
    """

    bound: float
    at: Floats | None = None
    value: float | None = None


@dataclass(frozen=True)
class _Boxes:
    """Undecided boxes and how they lie to the model.

    Parameters
    ----------
    forms : Determinants
    deep : (m,) bool
        Boxes known to lie wholly in the model.
    pairs : (n, 2) int64 or None
        Triangles that come near the boxes, sorted by box; None where that was not asked yet.
    """

    forms: Determinants
    deep: Bools
    pairs: Ints | None

    def take(self, chosen: Ints) -> _Boxes:
        """Some of the boxes, in another order, or more than once."""
        pairs = self.pairs
        if pairs is not None:
            pairs = repeat_pairs(pairs, self.forms.count, chosen)
        return _Boxes(self.forms.take(chosen), self.deep[chosen], pairs)

    def split(self) -> _Boxes:
        """All of them halved."""
        forms, parents = self.forms.split()
        related = self.take(parents)
        return _Boxes(forms, related.deep, related.pairs)


def prove_positive(
    blocks: Iterable[Determinants], domain: Domain, seen: float, *, share: float
) -> Search:
    """Prove that determinants are positive all over a domain, or find a point where they are not.

    Parameters
    ----------
    blocks : Determinants of the cells that cover the domain, or of those in question
    domain : Domain
    seen : float
        The least value met so far at points of the domain.
    share : float
        Boxes count as settled where their bound is positive and at least this share of the least
        value seen: 0 asks for the sign alone.
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
            return _negative(boxes, points[least], float(values[least]), int(owners[least]))
        seen = min(seen, float(values.min(initial=np.inf)))
        lower = boxes.forms.lower_bounds()
        good = _settled(lower, seen, share)
        bound = min(bound, float(lower[good].min(initial=np.inf)))
        boxes, lower = boxes.take(np.flatnonzero(~good)), lower[~good]
        spent += 2 * boxes.forms.forms.size
        enough = _POLISH if np.all(lower > 0) else _BUDGET
        if seen <= 0 or spent > enough:
            return Search(min(bound, float(lower.min(initial=np.inf))))
        if boxes.forms.count:
            boxes = boxes.split()
    return Search(bound)


def _settled(lower: Floats, seen: float, share: float) -> Bools:
    return np.asarray((lower > 0) & (lower >= share * seen if share else True))


def _in_model(boxes: _Boxes, domain: Domain) -> _Boxes:
    """Only boxes that meet the model."""
    forms = boxes.forms
    kept, deep, pairs = in_model(
        domain, forms.low[:, :3], forms.high[:, :3], boxes.deep, boxes.pairs
    )
    return _Boxes(forms, deep, pairs).take(np.flatnonzero(kept))


def _tries(boxes: _Boxes, domain: Domain) -> tuple[Floats, Floats, Floats, Ints]:
    """Points of the model in the boxes, determinants there, the rounding in those, and the box."""
    forms = boxes.forms
    deep = np.flatnonzero(boxes.deep)
    points, values, slack = forms.corner_values(deep)
    owners = np.resize(deep, len(points))
    if boxes.pairs is None or not len(boxes.pairs):
        return points, values, slack, owners
    pairs = boxes.pairs[:: -(-len(boxes.pairs) // _MOST_TRIES)]
    owner = pairs[:, 0]
    middle = (forms.low + forms.high)[owner] / 2
    # Edits scaled up fold more: with s the upper end of its interval is tried.
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
    """The finding at a point; a corner is moved a little into its box if that keeps the sign.

    On a knot plane across which the volume is only C0 it would not be clear on which side of it
    the determinant is negative.
    """
    forms = boxes.forms
    if boxes.deep[owner]:
        middle = (forms.low[owner] + forms.high[owner]) / 2
        within = point + _NUDGE * (middle - point)
        (found,), (doubt,) = forms.values(np.array([owner]), within[None])
        if found < -doubt:
            return Search(-np.inf, within, float(found))
    return Search(-np.inf, point, value)
