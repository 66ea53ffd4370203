"""Weighted least squares with a bending energy that decides where the data is silent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.fit.basis import FitBasis
from ffdcli.lattice.fit.cholesky import dissect
from ffdcli.lattice.fit.robust import Neighbours
from ffdcli.lattice.fit.smoothing import Scored, System, choose_smooth

# Change of a weight that asks for another round.
_CHANGED = 0.1
# Steps of refinement at most. One that moves the pairs by less, relative to the displacements or to
# the residual, is the last.
_STEPS = 60
_ROUNDING = 1e-15
# Steps after which the residual is computed anew, so that rounding does not gather.
_FRESH = 4
_VISIBLE = 1e-3
# Eigenvalue, relative to the largest, below which held points depend on each other.
_DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class FitData:
    """Pairs of a fit, in the lattice frame.

    Parameters
    ----------
    places : (m, 3) float64
        Points of the undeformed object, inside the lattice box.
    wanted : (m, 3) float64
        Displacements of their images.
    weights : (m,) float64
        Weights of the squared distances, positive.
    """

    places: Floats
    wanted: Floats
    weights: Floats


@dataclass(frozen=True, eq=False)
class Anchors:
    """What a fit is held by besides its pairs.

    Parameters
    ----------
    rows : (h, n) sparse
        Effect of the unknowns at points that are held.
    moves : (h, 3) float64
        Displacements that these points must have.
    corners : (8, n) sparse or None
        Effect at the corners of the box, where the pairs leave affine fields open.
    """

    rows: csr_array
    moves: Floats
    corners: csr_array | None

    @property
    def products(self) -> csr_array | None:
        """(n, n) products of the unknowns at the corners."""
        return None if self.corners is None else csr_array(self.corners.T @ self.corners)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A solution.

    Parameters
    ----------
    moves : (n, 3) float64
        Moves of the unknowns.
    left : (m, 3) float64
        What each image lacks to its target.
    factors : (m,) float64
        From 0 to 1: what is left of the weight of each pair; less than 1 for outliers.
    noise : float
        Root mean square of what the fit takes for noise.
    score : float
        Mean squared error of a pair that is left out, by generalised cross-validation.
    smooth : float
        Weight of the bending energy.
    silent : bool
        Whether the energy decides only where the data is silent.
    exact : bool
        Whether the functions can meet the data besides.
    leverage : (m,) float64
        Estimates of the share of each pair in its own image.
    """

    moves: Floats
    left: Floats
    factors: Floats
    noise: float
    score: float
    smooth: float
    silent: bool
    exact: bool
    leverage: Floats

    @property
    def outlier(self) -> Bools:
        """(m,) pairs that count less than half."""
        return np.asarray(self.factors < 0.5)

    def weighed(self, near: Neighbours) -> Floats:
        """(m,) weights from 0 to 1 that follow from the residual."""
        return near.factors(self.left, self.factors, self.leverage)

    def unsettled(self, near: Neighbours) -> bool:
        """Whether the weights that follow from the residual differ from those it came from."""
        return bool(np.abs(self.weighed(near) - self.factors).max() > _CHANGED)


@dataclass(frozen=True, eq=False)
class FitSettings:
    """How a fit is solved.

    Parameters
    ----------
    smooth : float or None
        Weight of the bending energy; None to choose it.
    near : Neighbours or None
        For weights that follow the residual; None for weights as given.
    start : Fitted or None
        A solution with these or other functions, whose weights and smoothing are a start.
    rounds : int
        Times that the weights follow the residual, at most.
    """

    smooth: float | None
    near: Neighbours | None
    start: Fitted | None = None
    rounds: int = 4


def solve_fit(basis: FitBasis, data: FitData, anchors: Anchors, settings: FitSettings) -> Fitted:
    """The moves of least sum of mean squared residual and bending energy.

    Exact data is met as well as the functions can: the energy then decides only where the data is
    silent. The weights of outliers follow the residual (iteratively reweighted least squares).
    """
    order = dissect(basis.supports)
    start, near = settings.start, settings.near
    factors = np.ones(len(data.wanted))
    if near is not None:
        # At first the displacements themselves tell: a fit may give way to a pair at the rim.
        first = near.factors(data.wanted, factors, np.zeros(len(factors)))
        factors = first if start is None else start.weighed(near)
    scored = None
    for number in range(settings.rounds):
        weights = data.weights * factors
        shares = weights / weights.sum()
        if scored is None or settings.start is None:
            system = System.of(basis, shares, order, anchors.products)
            scored = choose_smooth(system, data.wanted, settings.smooth, start)
        # Small changes of the weights leave the factors good enough for conjugate gradients.
        moves = _refined(basis, shares, data.wanted, anchors, scored)
        found = _fitted(data.wanted - basis.at_pairs(moves), moves, factors, scored)
        if near is None or number + 1 == settings.rounds or not found.unsettled(near):
            break
        start, factors = found, found.weighed(near)
    return found


def _fitted(left: Floats, moves: Floats, factors: Floats, scored: Scored) -> Fitted:
    return Fitted(
        moves,
        left,
        factors,
        noise=scored.noise,
        score=scored.score,
        smooth=scored.smooth,
        silent=scored.silent,
        exact=scored.exact,
        leverage=scored.leverage,
    )


def _refined(
    basis: FitBasis, weights: Floats, wanted: Floats, anchors: Anchors, scored: Scored
) -> Floats:
    """Moves (n, 3), by conjugate gradients from the factors of the matrix.

    The residual itself is used, whose digits squared systems lose. Where the functions can meet the
    data, the energy has no part in what is minimised.
    """
    shares, factors = weights[:, None], scored.factors
    weight = 0.0 if scored.exact else scored.smooth
    moves = np.zeros((len(basis.unknowns), 3))
    through, inverse = moves[:, :0], np.zeros((0, 0))
    if len(anchors.moves):
        through = factors.solve(anchors.rows.T.toarray())
        inverse = np.linalg.pinv(anchors.rows @ through, rcond=_DEPENDENT, hermitian=True)
        moves = through @ (inverse @ anchors.moves)
    way, before = np.zeros_like(moves), np.ones(3)
    left = wanted - basis.at_pairs(moves)
    for number in range(_STEPS):
        slope = basis.to_unknowns(shares * left) - weight * (basis.energy @ moves)
        step = factors.solve(slope)
        step -= through @ (inverse @ (anchors.rows @ step))
        gain = np.einsum("nc,nc->c", slope, step)
        if not np.all(np.isfinite(gain)):
            break
        way = step + (gain / before if number else 0.0) * way
        before = np.where(gain > 0, gain, 1.0)
        effect = basis.at_pairs(way)
        curve = (shares * effect**2).sum(axis=0)
        curve += weight * np.einsum("nc,nc->c", way, basis.energy @ way)
        length = np.where(curve > 0, gain / np.where(curve > 0, curve, 1.0), 0.0)
        moves = moves + length * way
        left = wanted - basis.at_pairs(moves) if number % _FRESH == 0 else left - length * effect
        size = np.sqrt((shares * (length * effect) ** 2).sum())
        rest = np.sqrt((shares * left**2).sum())
        if size <= max(_ROUNDING * np.abs(wanted).max(initial=0.0), _VISIBLE * rest):
            break
    # Rounding of the steps; each time it becomes less by some digits.
    for _ in range(3):
        moves = moves + through @ (inverse @ (anchors.moves - anchors.rows @ moves))
    return moves
