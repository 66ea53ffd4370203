"""Gauss rules, and adaptive quadrature that knows its error."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import sums

# Two rules agree where they differ by this share of the scale of the integrals. The error of the
# better one is then below 3e-12 of the scale, by ``error_of``.
AGREE = 1e-10
# Points evaluated in dividing pieces, for all integrals of a call together. What is open then is
# part of the error.
MOST_POINTS = 2**22


class Integrals(NamedTuple):
    """Integrals (n, k) and bounds, by estimate, of their errors (n, k)."""

    values: Floats
    errors: Floats


def gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes, as shares of an interval, and weights, which add up to 2."""
    return _gauss(count)


@lru_cache(maxsize=64)
def _gauss(count: int) -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights


def error_of(difference: Floats, scale: Floats) -> Floats:
    """Estimate the error of the better of two rules from their difference.

    Gauss rules converge like powers, so the better one is off by far less than the two differ.
    The estimate, and its safety factor of 200, is that of QUADPACK (Piessens et al. 1983).

    Parameters
    ----------
    difference : (..., k) float64
        Absolute differences of two rules, the better of at least 1.5 times as many points.
    scale : (k,) float64
        Size of the integrals.
    """
    share = np.divide(difference, scale, out=np.zeros_like(difference), where=scale > 0)
    return np.minimum(difference, scale * (200 * share) ** 1.5)


def refine(
    owner: Ints,
    pieces: Floats,
    rules: Callable[[Ints, Floats], tuple[Floats, Floats]],
    divide: Callable[[Floats], Floats],
    scale: Floats,
    points: int,
    agree: float = AGREE,
) -> Integrals:
    """Integrals over owners' pieces; pieces whose two rules disagree are divided, all at once.

    Parameters
    ----------
    owner : (n,) int64
    pieces : (n, ...) float64
    rules : callable
        Owners and pieces -> their integrals (m, k) by a rule, and by a better one.
    divide : callable
        Pieces (m, ...) -> their parts (m, parts, ...).
    scale : (k,) float64
        Size of the integrals, with which differences are compared.
    points : int
        Points of both rules together, for the effort: at most ``MOST_POINTS`` are evaluated, those
        of the worst pieces first.
    agree : float
        Share of the scale.

    Returns
    -------
    Integrals
        Sums over the pieces of each owner, for owners up to the last.
    """
    count = int(owner.max(initial=-1)) + 1
    values, errors = np.zeros((2, count, len(scale)))
    left = MOST_POINTS // points - len(owner)
    while len(owner):
        low, high = rules(owner, pieces)
        difference = np.abs(high - low)
        worst = (difference - agree * scale).max(axis=1)
        order = np.argsort(-worst, kind="stable")
        parts = divide(pieces[order[:1]]).shape[1]
        going = order[: min(int((worst > 0).sum()), max(left, 0) // parts)]
        done = np.ones(len(owner), dtype=bool)
        done[going] = False
        values += sums(owner[done], high[done], count)
        errors += sums(owner[done], error_of(difference[done], scale), count)
        parted = divide(pieces[going])
        owner, pieces = np.repeat(owner[going], parts), parted.reshape(-1, *pieces.shape[1:])
        left -= len(owner)
    return Integrals(values, errors)
