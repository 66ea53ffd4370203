"""Steps of a registration: the planes at the surface meet points, with least bending energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.fit.basis import FitBasis
from ffdcli.lattice.fit.cholesky import dissect
from ffdcli.lattice.fit.smoothing import System

# Weight of distances along the surface beside those across it.
_ALONG = 0.01
# Steps of conjugate gradients at most; the gain, relative to the first, that ends them.
_STEPS = 60
_ENOUGH = 1e-4


@dataclass(frozen=True, eq=False)
class PlanePairs:
    """Places on a surface, and what is missing from their images to points.

    Parameters
    ----------
    wanted : (m, 3) float64
    normals : (m, 3) float64
        Unit normals of the surface.
    """

    wanted: Floats
    normals: Floats


def plane_step(basis: FitBasis, pairs: PlanePairs, smooth: float, before: Floats) -> Floats:
    """Moves (n, 3) of the unknowns beyond those before (n, 3).

    They have the least sum of the mean squared distance of the points from the moved planes (Chen
    and Medioni 1992) and the bending energy of all moves. Solved by conjugate gradients from the
    factors of the same with whole distances.
    """
    share = 1 / len(pairs.wanted)
    system = System.of(basis, np.full(len(pairs.wanted), share), dissect(basis.supports), None)
    factors, smooth = system.factor(smooth), max(smooth, system.silent)

    def weighed(vectors: Floats) -> Floats:
        across = np.einsum("mc,mc->m", pairs.normals, vectors)[:, None] * pairs.normals
        return np.asarray(share * (across + _ALONG * vectors))

    moves = np.zeros_like(before)
    slope = basis.to_unknowns(weighed(pairs.wanted)) - smooth * (basis.energy @ before)
    step = factors.solve(slope)
    gain = float((slope * step).sum())
    first, way = gain, step
    for _ in range(_STEPS):
        if not gain > _ENOUGH**2 * first:
            break
        effect = basis.to_unknowns(weighed(basis.at_pairs(way))) + smooth * (basis.energy @ way)
        curve = float((way * effect).sum())
        if not curve > 0:
            break
        moves = moves + gain / curve * way
        slope = slope - gain / curve * effect
        step = factors.solve(slope)
        gain, last = float((slope * step).sum()), gain
        way = step + gain / last * way
    return moves
