"""Volume that a deformed mesh encloses, as fluxes through its triangles."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks, sums
from ffdcli.brep.evaluate.quadrature import AGREE, error_of, refine
from ffdcli.verify.cut import cut_along
from ffdcli.verify.deformed_mesh import POINTS, DeformedMesh

# Rules, of so many points squared, on parts of divided triangles.
RULES = (8, 12)


def fluxes(image: DeformedMesh, centre: Floats, *, agree: float = AGREE) -> tuple[Floats, Floats]:
    """Flux of (x - centre) / 3 through the image of every triangle, and its error, (T,) each.

    Triangles are cut where the deformation has breaks, so each piece's integrand is a polynomial
    of total degree ``3 d - 2``, d the degree of the deformation; its rule is exact. Lower
    rules come first and suffice if two of them agree, to the share ``agree`` of the mean flux.
    Quotients, and other maps, have no exact rule: pieces where rules do not agree are divided.
    Both are cubed model lengths; the error is an estimate.
    """
    owner, corners = cut_along(image.corners, image.deformation.breaks)
    exact = -(-(3 * image.deformation.degree - 1) // 2)
    smooth = not (image.deformation.rational or image.deformation.needs_fit)
    rules = [rule for rule in (2, 3, 5, 8) if rule < exact] + [exact]
    todo = np.arange(len(owner))
    best = _triangle_fluxes(image, corners, rules[0], centre)
    errors = np.zeros_like(best)
    scale = np.zeros(1)
    for rule in rules[1:] if smooth else [*rules[1:], 2 * exact]:
        better = _triangle_fluxes(image, corners[todo], rule, centre)
        difference = np.abs(better - best[todo])
        scale = np.array([np.abs(best).sum() / max(len(owner), 1)])
        best[todo], errors[todo] = better, error_of(difference, scale)
        todo = todo[difference > agree * scale]
        if not len(todo):
            break
    if smooth:
        errors[todo] = 0.0
    elif len(todo):

        def both(_: Ints, pieces: Floats) -> tuple[Floats, Floats]:
            low, high = (_triangle_fluxes(image, pieces, rule, centre)[:, None] for rule in RULES)
            return low, high

        points = sum(rule**2 for rule in RULES)
        numbers = np.arange(len(todo))
        parted = refine(numbers, corners[todo], both, _quarters, scale, points, agree)
        best[todo], errors[todo] = parted.values[:, 0], parted.errors[:, 0]
    count = len(image.corners)
    return sums(owner, best, count), sums(owner, errors, count)


def _quarters(corners: Floats) -> Floats:
    """(n, 4, 3, 3) triangles between the corners of triangles (n, 3, 3) and their midpoints."""
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    before = np.roll(middles, 1, axis=1)
    return np.concatenate([np.stack([corners, middles, before], axis=2), middles[:, None]], axis=1)


def _triangle_fluxes(image: DeformedMesh, corners: Floats, rule: int, centre: Floats) -> Floats:
    """(n,) flux through the images of triangles (n, 3, 3), by a rule of rule² points."""
    # Collapsed square: Gauss-Jacobi towards the first corner, Gauss-Legendre across.
    out, out_weights = roots_jacobi(rule, 0, 1)
    over, over_weights = np.polynomial.legendre.leggauss(rule)
    out, over = (out + 1) / 2, (over + 1) / 2
    params = np.stack([(out[:, None] * (1 - over)).ravel(), (out[:, None] * over).ravel()], axis=1)
    weights = np.outer(out_weights / 4, over_weights / 2).ravel()
    flux = np.empty(len(corners))
    for part in chunks(len(corners), max(1, POINTS // len(weights))):
        corner = corners[part]
        sides = corner[:, 1:] - corner[:, :1]
        points = (corner[:, :1] + params @ sides).reshape(-1, 3)
        arm = image.deformation.images(points) - centre
        turned = np.repeat(sides, len(weights), axis=0) @ np.swapaxes(
            image.deformation.jacobian(points), 1, 2
        )
        value = (arm * np.cross(turned[:, 0], turned[:, 1])).sum(axis=1) / 3
        flux[part] = value.reshape(len(corner), -1) @ weights
    return flux
