"""Volume that a deformed mesh encloses, as fluxes through its triangles."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from ffdcli.arrays import Floats
from ffdcli.brep.evaluate.bspline import chunks, sums
from ffdcli.verify.cut import cut_along
from ffdcli.verify.deformed_mesh import POINTS, DeformedMesh

# As for the volume of faces: two rules that agree to this share are accurate enough.
AGREE = 1e-10


def fluxes(image: DeformedMesh, centre: Floats, *, agree: float = AGREE) -> Floats:
    """(T,) flux of (x - centre) / 3 through the image of every triangle, cubed model length.

    Triangles are cut where the deformation has breaks, so each piece's integrand is a polynomial
    of total degree ``3 d - 2``, d the degree of the deformation; its rule is exact. Lower
    rules come first and suffice if two of them agree, to the share ``agree`` of the mean flux.
    Quotients have no exact rule: higher rules follow.
    """
    owner, corners = cut_along(image.corners, image.deformation.breaks)
    exact = -(-(3 * image.deformation.degree - 1) // 2)
    rules = [rule for rule in (2, 3, 5, 8) if rule < exact] + [exact]
    rules += [2 * exact, 4 * exact] if image.deformation.rational else []
    todo = np.arange(len(owner))
    best = _triangle_fluxes(image, corners, rules[0], centre)
    for rule in rules[1:]:
        better = _triangle_fluxes(image, corners[todo], rule, centre)
        limit = agree * np.abs(best).sum() / max(len(owner), 1)
        going = np.abs(better - best[todo]) > limit
        best[todo] = better
        todo = todo[going]
        if not len(todo):
            break
    return sums(owner, best, len(image.corners))


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
