"""The search behind the certificate: halve boxes until the sign of det J is proved on all of them.

A polynomial in Bernstein form lies in the hull of its coefficients, and the corner ones are values
of it. Boxes whose coefficients are all well above zero are settled; the others are halved until
they are, or have left the model, or a point of the model with a negative determinant turns up, or
the budget is spent. All boxes of a round are treated at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ffdcli.volume.determinant import Determinants, concatenate
from ffdcli.volume.domain import Domain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Coefficients of halved boxes after which the search is given up; and after which, where the sign
# is proved and only the bound is loose, the bound is taken as it is.
_BUDGET = 8_000_000
_POLISH = 1_000_000
# Share of a box's width.
_NUDGE = 2.0**-20
# Points of the surface tried in one round.
_MOST_TRIES = 4_000


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
            starts = np.searchsorted(pairs[:, 0], np.arange(self.forms.count + 1))
            pairs = _repeat(pairs[:, 1], starts, chosen)
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
    blocks : Determinants of the cells that cover the domain
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
    forms = concatenate(kept)
    boxes = _Boxes(forms, np.zeros(forms.count, dtype=bool), None)
    spent = 0
    while boxes.forms.count:
        boxes = _in_model(boxes, domain)
        points, values, slack = _tries(boxes, domain)
        if np.any(values < -slack):
            least = int(np.argmin(values + slack))
            return Search(-np.inf, points[least], float(values[least]))
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
    """Only boxes that meet the model; those its surface does not touch become deep, or go."""
    forms, deep = boxes.forms, boxes.deep
    low, high = forms.low[:, :3], forms.high[:, :3]
    among = boxes.pairs
    if among is None:
        pairs = domain.touching(low, high, None)
    else:
        pairs = domain.touching(low, high, among) if len(among) else among
    touched = np.zeros(forms.count, dtype=bool)
    touched[pairs[:, 0]] = True
    alone = np.flatnonzero(~touched & ~deep)
    deep = deep.copy()
    deep[alone] = domain.holds((low[alone] + high[alone]) / 2)
    return _Boxes(forms, deep, pairs).take(np.flatnonzero(touched | deep))


def _tries(boxes: _Boxes, domain: Domain) -> tuple[Floats, Floats, Floats]:
    """Points of the model in the boxes, the determinants there, and the rounding in those."""
    forms = boxes.forms
    dimension = forms.low.shape[1]
    # Corners, very little inside: on the box's own side of knot planes.
    corner = np.array(list(product((_NUDGE, 1 - _NUDGE), repeat=dimension)))
    deep = np.flatnonzero(boxes.deep)
    owners = np.repeat(deep, len(corner))
    width = (forms.high - forms.low)[owners]
    points = forms.low[owners] + np.tile(corner, (len(deep), 1)) * width
    if boxes.pairs is not None and len(boxes.pairs):
        pairs = boxes.pairs[:: -(-len(boxes.pairs) // _MOST_TRIES)]
        owner = pairs[:, 0]
        middle = (forms.low + forms.high)[owner] / 2
        # Edits scaled up fold more: with s the upper end of its interval is tried.
        near = np.column_stack([domain.nearest(pairs, middle[:, :3]), forms.high[owner, 3:]])
        within = np.all((near >= forms.low[owner]) & (near <= forms.high[owner]), axis=1)
        owners = np.concatenate([owners, owner[within]])
        points = np.concatenate([points, near[within]])
    values, slack = forms.values(owners, points)
    return points, values, slack


def _repeat(items: Ints, starts: Ints, chosen: Ints) -> Ints:
    """Pairs of each chosen owner's new number with its items, items of owner i from starts[i]."""
    counts = (starts[1:] - starts[:-1])[chosen]
    ends = np.cumsum(counts)
    place = np.arange(int(counts.sum())) - np.repeat(ends - counts, counts)
    owner = np.repeat(np.arange(len(chosen)), counts)
    return np.column_stack([owner, items[starts[chosen][owner] + place]])
