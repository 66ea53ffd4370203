"""The largest scale of the edits that provably does not fold the model.

The control points of a scaled lattice are linear in the scale s, homogeneous ones (with scaled
weights) quadratic. So s is a fourth variable of the Bernstein forms of det J, and an interval of
scales is certified at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.folds.certificate import determinants, sample
from ffdcli.folds.determinant import find_cells
from ffdcli.folds.domain import SearchDomain
from ffdcli.folds.search import prove_positive
from ffdcli.volume.protocol import Volume

# Relative distance of proof and counter-example at which the search ends.
_CLOSE = 5e-3
# Scales sampled before the first proof.
_STEPS = 16
# Intervals tried at most; and, among them, intervals without a result.
_MOST_ROUNDS = 24
_MOST_UNPROVED = 4


@dataclass(frozen=True)
class ScaleLimit:
    """Range of scales for which the edits are injective.

    Parameters
    ----------
    proved : float
        For every scale from 0 to this one det J is proved to be positive all over the domain.
    folds : float or None
        The smallest scale found for which det J is negative at ``at``; None where none was found
        up to the largest scale examined.
    at : (3,) float64 or None, lattice frame
    value : float or None
        det J there.
    """

    proved: float
    folds: float | None = None
    at: Floats | None = None
    value: float | None = None


def find_scale_limit(
    scaled: Callable[[float], Volume], domain: SearchDomain, most: float
) -> ScaleLimit:
    """Find the largest s, at most ``most``, such that every scale from 0 to s is injective.

    Parameters
    ----------
    scaled : callable
        The volume at a scale; the identity at 0. All have the same knots.
    domain : SearchDomain
    most : float
        Greater than 0.
    """
    limit = _sampled_limit(scaled, domain, most)
    # `doubtful`: end of an interval without a result. `refuted`: the last had a counter-example.
    doubtful, unproved, refuted = np.inf, 0, False
    for _ in range(_MOST_ROUNDS):
        target = most if limit.folds is None else (1 - _CLOSE / 2) * limit.folds
        if refuted or doubtful <= target:
            target = (limit.proved + min(limit.folds or most, doubtful)) / 2
        volume = scaled(target)
        nets = _nets(scaled, limit.proved, target)
        cells = find_cells(volume, domain.bounds[0], domain.bounds[1])
        blocks = determinants(
            volume, cells[~volume.is_identity(cells)], nets, (limit.proved, target)
        )
        search = prove_positive(blocks, domain, np.inf, share=0)
        refuted = search.at is not None
        if search.at is not None:
            folds = float(search.at[3])
            limit = replace(limit, folds=folds, at=search.at[:3], value=search.value)
            limit = _lowered(scaled, search.at[None, :3], limit.proved, folds, limit)
        elif search.bound > 0:
            limit = replace(limit, proved=target)
        else:
            unproved += 1
            doubtful = target
        end = min(limit.folds or most, doubtful)
        if end - limit.proved <= _CLOSE * end or unproved == _MOST_UNPROVED:
            break
    return limit


def _sampled_limit(
    scaled: Callable[[float], Volume], domain: SearchDomain, most: float
) -> ScaleLimit:
    """The smallest sampled scale that folds sample points; nothing is proved."""
    before = 0.0
    for s in np.linspace(0, most, _STEPS + 1)[1:].tolist():
        points, found = sample(scaled(s), domain)
        if np.any(found < 0):
            least = int(np.argmin(found))
            limit = ScaleLimit(0.0, s, points[least], float(found[least]))
            return _lowered(scaled, points[found < 0], before, s, limit)
        before = s
    return ScaleLimit(0.0)


def _lowered(
    scaled: Callable[[float], Volume], points: Floats, low: float, high: float, limit: ScaleLimit
) -> ScaleLimit:
    """The limit, folded at scale ``high``, lowered by bisection on points (n, 3)."""
    while high - low > _CLOSE / 8 * high:
        middle = (low + high) / 2
        found = np.linalg.det(scaled(middle).jacobian(points))
        least = int(np.argmin(found))
        if found[least] < 0:
            high = middle
            limit = replace(limit, folds=high, at=points[least], value=float(found[least]))
            points = points[found < 0]
        else:
            low = middle
    return limit


def _nets(scaled: Callable[[float], Volume], low: float, high: float) -> tuple[Floats, ...]:
    """Bernstein coefficients of the net in s over an interval: two, or three with weights."""
    first, middle, last = (scaled(s).net for s in (low, (low + high) / 2, high))
    if last.shape[-1] == 3:
        return first, last
    if first.shape[-1] == 3:
        # At rest all weights are 1.
        first = np.concatenate([first, np.ones((*first.shape[:3], 1))], axis=-1)
    return first, 2 * middle - (first + last) / 2, last
