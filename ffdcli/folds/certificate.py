"""Certificates of local injectivity: the sign of det J over the model, proved or disproved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb
from typing import Literal

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.folds.determinant import Determinants, cell_determinants, find_cells
from ffdcli.folds.domain import SearchDomain
from ffdcli.folds.hulls import settle
from ffdcli.folds.search import prove_positive
from ffdcli.volume.protocol import Volume

# A bound of det J suffices at this share of the least sampled value.
_SHARE = 0.5
# Coefficients of the cells treated together: bounds the memory.
_CHUNK = 2_000_000
# Beyond this a proof takes too long: minutes.
_MOST_COEFFICIENTS = 60_000_000
# A sampled det J counts as zero up to this share of the product of its columns' lengths: smaller
# values may be rounding.
_NOISE = 1e-9


@dataclass(frozen=True)
class Sign:
    """The sign of det J over a domain, as far as it is known.

    Parameters
    ----------
    locally_injective : {"yes", "no", "unproved"}
        "yes" where ``sense * det J`` is proved positive all over the domain, "no" where it is
        negative at a point.
    sense : {1, -1}
        -1 where the deformation mirrors.
    bound : float or None
        A proved lower bound of ``sense * det J`` over the domain; None with "no", and where the
        cells are too many for a proof.
    at : (3,) float64 or None, lattice frame
        With "no", a point of the domain where ``sense * det J`` is negative.
    value : float or None
        ``sense * det J`` there.
    """

    locally_injective: Literal["yes", "no", "unproved"]
    sense: int
    bound: float | None = None
    at: Floats | None = None
    value: float | None = None


def certify(volume: Volume, domain: SearchDomain, *, may_mirror: bool) -> Sign:
    """Prove that det J keeps one sign over a domain, or find a point where it does not.

    A deformation whose det J keeps one sign is locally injective, by the inverse function theorem.
    This holds on knot planes of continuity C0 too: the linear maps on both sides agree on the plane
    and have the same orientation, and the four around an edge fill less than two full turns.

    Parameters
    ----------
    volume : Volume
        Polynomial, or rational with positive weights.
    domain : SearchDomain
    may_mirror : bool
        False where the model reaches out of the lattice box, since it is not mirrored there.
    """
    samples, found = sample(volume, domain)
    sense = -1 if may_mirror and len(found) and np.median(found) < 0 else 1
    found = sense * found
    if np.any(found < 0):
        lowest = int(np.argmin(found))
        return Sign("no", sense, at=samples[lowest], value=float(found[lowest]))
    every = find_cells(volume, domain.bounds[0], domain.bounds[1])
    # On cells at rest det J is 1. Where the rest is mirrored that is a fold, which the forms show.
    cells = every[~volume.is_identity(every)] if sense > 0 else every
    seen, settled = float(found.min(initial=np.inf)), np.inf
    if len(cells) < len(every):
        settled = 1.0
    if volume.net_kind.rational:
        # Forms of quotients have a high degree; balls decide most cells with less work.
        enough = max(_SHARE * seen, float(np.finfo(float).tiny))
        # Hulls are given up once they take as much work as the forms.
        effort = len(cells) * form_products(volume)
        least, left, _ = settle(volume, cells, domain, sense, enough, effort=effort)
        settled, cells = min(settled, least), cells[left]
    if len(cells) * _coefficients(volume) > _MOST_COEFFICIENTS:
        return Sign("unproved", sense)
    search = prove_positive(
        (block.turned(sense) for block in determinants(volume, cells, (volume.net,))),
        domain,
        seen,
        share=_SHARE,
    )
    if search.at is not None:
        return Sign("no", sense, at=search.at, value=search.value)
    bound = min(search.bound, settled)
    return Sign("yes" if bound > 0 else "unproved", sense, bound=bound)


def sample(volume: Volume, domain: SearchDomain) -> tuple[Floats, Floats]:
    """Sample points (n, 3) of a domain, and det J (n,) there; 0 within rounding."""
    slopes = domain.slopes(volume)
    found = np.linalg.det(slopes)
    noise = _NOISE * np.prod(np.linalg.norm(slopes, axis=1), axis=1)
    return domain.samples, np.where(np.abs(found) <= noise, 0.0, found)


def form_products(volume: Volume, nets: int = 1) -> int:
    """About the number of multiplications that the form of det J on one cell takes.

    Parameters
    ----------
    nets : int
        Number of control nets, as for :func:`determinants`.
    """
    kind = volume.net_kind
    degrees = [*(kind.degree(k) for k in volume.degrees), nets - 1]
    size = [int(np.prod([n * degree + 1 for degree in degrees])) for n in range(5)]
    order = 4 if kind.rational else 3
    # Minors of one more row: each is a sum of as many products as it has rows.
    minors = sum(comb(order, n) * n * size[1] * size[n - 1] for n in range(2, order + 1))
    return minors + (size[1] ** 2 + size[2] ** 2 if kind.rational else 0)


def _coefficients(volume: Volume) -> int:
    """Number of coefficients of the form of one cell."""
    factors = 4 if volume.net_kind.rational else 3
    return int(np.prod([factors * volume.net_kind.degree(k) + 1 for k in volume.degrees]))


def determinants(
    volume: Volume, cells: Ints, nets: Sequence[Floats], interval: Sequence[float] = ()
) -> Iterator[Determinants]:
    """Forms of det J on cells (m, 3), in parts that bound the memory.

    Parameters are as for :func:`ffdcli.folds.determinant.cell_determinants`.
    """
    size = len(nets) * _coefficients(volume)
    step = max(1, int(_CHUNK // size))
    for start in range(0, len(cells), step):
        yield cell_determinants(volume, cells[start : start + step], nets, interval)
