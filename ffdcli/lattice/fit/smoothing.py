"""The weight of the bending energy, by generalised cross-validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Floats
from ffdcli.lattice.fit.basis import FitBasis
from ffdcli.lattice.fit.cholesky import Cholesky, NotPositive, Order, cholesky

if TYPE_CHECKING:
    from ffdcli.lattice.fit.solve import Fitted

# Weight of the energy that decides only where the data is silent, relative to the data.
_SILENT = 1e-8
# Weight of the corners of the box where the pairs leave affine fields open, relative to the data.
_CORNERS = 1e-6
# Ratio of the weights that are tried.
_RATIO = 10**1.5
_MOST_TRIED = 24
# Share of a score that a better one may have at most.
_BETTER = 1 - 1e-6
# Unknowns up to which the trace is exact, and random vectors that estimate it beyond.
_EXACT_TRACE = 800
_PROBES = 10
# Unknowns beyond which a start from coarser functions is compared only with less smoothing, by this
# many ratios, and if that is better with none.
MANY = 3000
_LESS = 2
# Residual, relative to the displacements, up to which the energy may be all that is left of it.
_EXACT = 1e-6
# Growth of the diagonal, as a share, that makes dependent functions harmless.
_SHIFTS = (1e-14, 1e-12, 1e-10, 1e-8)


@dataclass(frozen=True, eq=False)
class System:
    """A fit with given weights.

    Parameters
    ----------
    basis : FitBasis
    shares : (m,) float64
        Weights of the pairs, of sum 1.
    order : Order
    products : (n, n) sparse
        Weighted products of the functions at the pairs.
    extra : (n, n) sparse or None
        Added to the matrix only, not to what is minimised.
    """

    basis: FitBasis
    shares: Floats
    order: Order
    products: csr_array
    extra: csr_array | None

    @staticmethod
    def of(basis: FitBasis, shares: Floats, order: Order, extra: csr_array | None) -> System:
        """The system of weights; ``extra`` gets a small weight."""
        products = basis.products(shares)
        if extra is not None:
            unit = products.diagonal().sum() / max(extra.diagonal().sum(), 1e-300)
            extra = csr_array(_CORNERS * unit * extra)
        return System(basis, shares, order, products, extra)

    @property
    def silent(self) -> float:
        """Weight of the energy that decides only where the data is silent."""
        energy = float(self.basis.energy.diagonal().sum())
        if not energy > 0:
            return 0.0
        return _SILENT * float(self.products.diagonal().sum()) / energy

    def factor(self, smooth: float) -> Cholesky:
        """Factors of the matrix with a weight of the energy."""
        matrix = self.products + max(smooth, self.silent) * self.basis.energy
        if self.extra is not None:
            matrix = matrix + self.extra
        for shift in _SHIFTS:
            try:
                return cholesky(csr_array(matrix), self.order, shift)
            except NotPositive:
                continue
        raise NotPositive


@dataclass(frozen=True, eq=False)
class Scored:
    """A weight of the energy, and how well it predicts.

    Parameters
    ----------
    smooth : float
    factors : Cholesky
    score : float
        Mean squared error of a pair that is left out.
    noise : float
        Root mean square of the noise.
    silent : bool
        Whether the energy decides only where the data is silent.
    exact : bool
        Whether the functions can meet the data besides.
    leverage : (m,) float64
        Estimates of the share of each pair in its own image.
    """

    smooth: float
    factors: Cholesky
    score: float
    noise: float
    silent: bool
    exact: bool
    leverage: Floats


def choose_smooth(
    system: System, wanted: Floats, smooth: float | None, start: Fitted | None
) -> Scored:
    """The weight of the energy with the least score, or the given one.

    Generalised cross-validation (Craven & Wahba 1979); the trace is estimated with random signs
    (Hutchinson 1990) where there are many functions. Weights are tried from a start upwards and
    downwards, until the score rises on both sides.
    """
    least = system.silent
    if smooth is not None:
        return _score(system, wanted, smooth)
    place = 0
    if start is not None and not start.silent:
        place = max(0, round(np.log(start.smooth / max(least, 1e-300)) / np.log(_RATIO)))
    tried: dict[int, Scored] = {}

    def at(number: int) -> Scored:
        if number not in tried:
            tried[number] = _score(system, wanted, least * _RATIO**number)
        return tried[number]

    best = place
    if start is not None and len(system.basis.unknowns) > MANY:
        less = max(place - _LESS, 0)
        return at(place) if at(place).score <= at(less).score else _better(at(less), at(0))
    for step in (1, -1):
        number = best
        # A single rise may be a wave of the score.
        while 0 <= number + step < _MOST_TRIED and abs(number - best) < 2:
            number += step
            if at(number).score < _BETTER * at(best).score:
                best = number
    return at(best)


def _better(first: Scored, second: Scored) -> Scored:
    return first if first.score <= second.score else second


def _score(system: System, wanted: Floats, smooth: float) -> Scored:
    basis, shares = system.basis, system.shares
    factors = system.factor(smooth)
    moves = factors.solve(basis.to_unknowns(shares[:, None] * wanted))
    left = wanted - basis.at_pairs(moves)
    mean = float((shares[:, None] * left**2).sum())
    used = np.count_nonzero(shares)
    leverage = _leverage(system, factors)
    trace = float(leverage.sum())
    if len(basis.unknowns) <= _EXACT_TRACE:
        trace = float(np.trace(factors.solve(system.products.toarray())))
    free = max(1 - trace / used, 1e-9)
    noise = float(np.sqrt(mean / free))
    size = float((shares[:, None] * wanted**2).sum())
    silent = smooth <= system.silent
    exact = silent and mean <= _EXACT**2 * size
    return Scored(smooth, factors, mean / free**2, noise, silent, exact, leverage)


def _leverage(system: System, factors: Cholesky) -> Floats:
    """(m,) estimates of the share of each pair in its own image."""
    basis, shares = system.basis, system.shares
    signs = np.random.default_rng(19).choice([-1.0, 1.0], (len(shares), _PROBES))
    rooted = np.sqrt(shares)[:, None] * signs
    moves = factors.solve(basis.to_unknowns(rooted))
    return np.asarray((rooted * basis.at_pairs(moves)).sum(axis=1) / _PROBES)
