"""Parameters of points in a weighted T-spline volume: the inverse of its map at rest.

Song & Yang (2005, section 5) solve ``P0(u) = x`` point by point with nonlinear conjugate
gradients. Here all points are solved at once, by Newton's method with the analytic Jacobian. A step
that does not reduce the residual is damped as in the method of Levenberg and Marquardt, and steps
are clipped to the box.

The paper assumes a unique solution. With weights 100:1 it is not unique: the map folds in empty
cells next to heavy ones. Solutions in folds are reported (:attr:`Preimages.folded`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.volume.adaptive.volume import AdaptiveVolume

# Residual, relative to the box's diagonal, at which a point counts as solved.
SOLVED = 1e-12
_MOST_STEPS = 100
# Damping after the first failed step; smallest damping that is kept.
_FIRST_DAMPING = 1e-3
_LEAST_DAMPING = 1e-6


@dataclass(frozen=True)
class Preimages:
    """Parameters of points.

    Parameters
    ----------
    parameters : (m, 3) float64, lattice frame
    residual : (m,) float64
        Distance of ``P0(parameters)`` from each point.
    solved : (m,) bool
        True where the residual is at most :data:`SOLVED` of the box's diagonal. Others have no
        parameters in the box, or none were found; theirs are the best approximation found.
    slopes : (m, 3, 3) float64
        Derivatives of ``P0`` at the parameters: [i, j] is d P0_i / d u_j.
    steps : (m,) int64
        Newton steps taken.
    """

    parameters: Floats
    residual: Floats
    solved: Bools
    slopes: Floats
    steps: Ints

    @property
    def folded(self) -> Bools:
        """(m,) True where the Jacobian determinant of the map at rest is not positive."""
        return np.asarray(np.linalg.det(self.slopes) <= 0)


def find_parameters(volume: AdaptiveVolume, points: Floats) -> Preimages:
    """Solve ``P0(u) = x`` for all points (m, 3), P0 the map of a weighted volume at rest."""
    rest = volume.rest_map
    low, high = volume.box
    enough = SOLVED * float(np.linalg.norm(high - low))
    at = np.clip(points, low, high)
    images, slopes = rest.linearise(at)
    gap = points - images
    residual = np.linalg.norm(gap, axis=1)
    damping = np.zeros(len(points))
    steps = np.zeros(len(points), dtype=np.int64)
    going = np.flatnonzero(residual > enough)
    for _ in range(_MOST_STEPS):
        if not len(going):
            break
        steps[going] += 1
        step = _steps(slopes[going], gap[going], damping[going])
        trial = np.clip(at[going] + step, low, high)
        image, slope = rest.linearise(trial)
        left = points[going] - image
        distance = np.linalg.norm(left, axis=1)
        better = distance < residual[going]
        kept = going[better]
        at[kept], slopes[kept], gap[kept] = trial[better], slope[better], left[better]
        residual[kept] = distance[better]
        eased = damping[going] / 10
        eased[eased < _LEAST_DAMPING] = 0.0
        raised = np.maximum(10 * damping[going], _FIRST_DAMPING)
        damping[going] = np.where(better, eased, raised)
        # A point whose damped steps have become tiny without progress is given up.
        stuck = ~better & (damping[going] > 1e9)
        going = going[(residual[going] > enough) & ~stuck]
    return Preimages(at, residual, residual <= enough, slopes, steps)


def _steps(slopes: Floats, gap: Floats, damping: Floats) -> Floats:
    """Newton steps (m, 3); damped ones solve ``(J^T J + d |J|^2 I) s = J^T gap``."""
    size = np.linalg.norm(slopes, axis=(1, 2))
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    turned = np.einsum("nij,ni->nj", slopes, gap)
    # Slight damping keeps singular systems solvable; Newton steps use J itself.
    normal += (np.maximum(damping, 1e-14) * size**2)[:, None, None] * np.eye(3)
    out = np.linalg.solve(normal, turned[:, :, None])[:, :, 0]
    plain = (damping == 0) & (np.abs(np.linalg.det(slopes)) > 1e-6 * size**3)
    out[plain] = np.linalg.solve(slopes[plain], gap[plain, :, None])[:, :, 0]
    return np.asarray(out)
