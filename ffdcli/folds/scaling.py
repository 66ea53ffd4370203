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
from ffdcli.folds.certificate import determinants, form_products, sample
from ffdcli.folds.determinant import find_cells
from ffdcli.folds.domain import SearchDomain
from ffdcli.folds.hulls import settle
from ffdcli.folds.search import Search, prove_positive
from ffdcli.stopwatch import Progress
from ffdcli.volume.protocol import Volume

# Relative distance of proof and counter-example at which the search ends.
_CLOSE = 5e-3
# Scales sampled before the first proof.
_STEPS = 16
# Intervals tried at most; and, among them, intervals without a result.
_MOST_ROUNDS = 24
_MOST_UNPROVED = 12
# Multiplications spent at most, ten to twenty seconds. One interval may spend half of what is left.
EFFORT = 20_000_000_000
# Multiplications for each coefficient of a halved box: a mean of some ten others, and its bounds.
_HALVED = 16
# Any positive bound proves the sign.
_TINY = float(np.finfo(float).tiny)


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
    complete : bool
        True where proof and fold met within half a percent, or all scales examined are proved.
        False where the effort allowed did not suffice: nothing is known of scales in between.
    steps : int
        Intervals of scales that were tried.
    effort : int
        Multiplications spent on them.
    """

    proved: float
    folds: float | None = None
    at: Floats | None = None
    value: float | None = None
    complete: bool = True
    steps: int = 0
    effort: int = 0


def find_scale_limit(
    scaled: Callable[[float], Volume],
    domain: SearchDomain,
    most: float,
    effort: int = EFFORT,
    progress: Progress | None = None,
) -> ScaleLimit:
    """Find the largest s, at most ``most``, such that every scale from 0 to s is injective.

    Parameters
    ----------
    scaled : callable
        The volume at a scale; the identity at 0. All have the same knots.
    domain : SearchDomain
    most : float
        Greater than 0.
    effort : int
        Multiplications after which the search ends, proved or not.
    progress : callable, optional
        Called with a few words before each step.
    """
    limit = sampled_limit(scaled, domain, most)
    # `doubtful`: end of an interval without a result. `refuted`: the last had a counter-example.
    doubtful, unproved, refuted = np.inf, 0, False
    for step in range(1, _MOST_ROUNDS + 1):
        if progress is not None:
            progress(
                f"scale: proved up to {limit.proved:.4g}, step {step} of at most {_MOST_ROUNDS}"
            )
        target = most if limit.folds is None else (1 - _CLOSE / 2) * limit.folds
        if step == 1:
            # The edits as they are come first.
            target = min(target, 1.0)
        elif refuted or doubtful <= target:
            target = (limit.proved + min(limit.folds or most, doubtful)) / 2
        search = _search(scaled, domain, limit.proved, target, (effort - limit.effort) // 2)
        limit = replace(limit, steps=step, effort=limit.effort + search.spent)
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
        # Where nothing was spent, the effort left does not suffice for any interval.
        if is_close(limit.proved, end) or unproved == _MOST_UNPROVED or not search.spent:
            break
    return replace(limit, complete=is_close(limit.proved, limit.folds or most))


def is_close(proved: float, end: float) -> bool:
    """Whether a proof reaches within half a percent of a fold, or of the largest scale."""
    return end - proved <= _CLOSE * end


def _search(
    scaled: Callable[[float], Volume],
    domain: SearchDomain,
    low: float,
    high: float,
    effort: int,
) -> Search:
    """Prove an interval of scales, find a fold, or neither; with the multiplications spent."""
    volume, nets = scaled(high), _nets(scaled, low, high)
    cells = find_cells(volume, domain.bounds[0], domain.bounds[1])
    cells = cells[~volume.is_identity(cells)]
    each, spent = form_products(volume, len(nets)), 0
    if volume.net_kind.rational:
        # Hulls may take as much as the forms, and leave enough for these if there is enough.
        forms = len(cells) * each
        most = min(forms, effort if forms > effort else effort - forms)
        _, left, spent = settle(volume, cells, domain, 1, _TINY, nets=nets, effort=most)
        cells = cells[left]
    if spent + len(cells) * each > effort:
        return Search(0.0, spent=spent)
    blocks = determinants(volume, cells, nets, (low, high))
    search = prove_positive(blocks, domain, np.inf, share=0)
    return replace(search, spent=spent + len(cells) * each + _HALVED * search.spent)


def sampled_limit(
    scaled: Callable[[float], Volume], domain: SearchDomain, most: float
) -> ScaleLimit:
    """The smallest scale, of some, that folds sample points; nothing is proved."""
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
    """Bernstein coefficients of the net over an interval: two, or three where weights change."""
    first, middle, last = (scaled(s).net for s in (low, (low + high) / 2, high))
    if last.shape[-1] == 3:
        return first, last
    if first.shape[-1] == 3:
        # At rest all weights are 1.
        first = np.concatenate([first, np.ones((*first.shape[:3], 1))], axis=-1)
    elif first.shape[-1] < last.shape[-1]:
        # At rest both quotients are the same.
        first = np.concatenate([last[..., 4:]] * 2, axis=-1)
    if np.array_equal(first[..., 3:], last[..., 3:]):
        return first, last
    return first, 2 * middle - (first + last) / 2, last
