"""Planes and lines whose images are B-splines: of the degree of the composition, exact to rounding.

The image of a line is a spline whose knots are its crossings with the knot planes. So is that of a
plane where these planes cut it along its parameter lines. Their control points follow from values
of the deformation, since the space of splines is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.part.fit import Fit, Target, axis_fits, evaluate, open_grid, poles_of, unseen
from ffdcli.part.surfaces import Plane
from ffdcli.volume.protocol import BoxMap

# Largest degree that is written; beyond it a fit takes fewer control points.
MOST_DEGREE = 9
# Components of unit vectors below this count as none.
_NONE = 1e-10
# Distances that count as rounding, as a share of the size.
_ROUNDING = 1e-12


def has_pieces(one: BoxMap) -> bool:
    """Whether values of a map, or of its numerator and denominator, are polynomials in pieces."""
    kind = one.net_kind
    return not one.needs_fit and (
        not kind.rational or (not kind.displaces and kind.components == 4)
    )


def turned_plane(plane: Plane, one: BoxMap) -> Plane:
    """The same plane with a parameter along an axis of a map that it is parallel to, if any is.

    Then all knot planes cut it along parameter lines.
    """
    axes = one.frame.axes
    across = np.abs(axes @ plane.z)
    along = axes[np.argmin(across)]
    own = np.stack([plane.x, plane.y], axis=1)
    if across.min() > _NONE or np.abs(axes[across <= _NONE] @ own).max() > 1 - _NONE:
        return plane
    y = along - plane.z * (plane.z @ along)
    y /= np.linalg.norm(y)
    side = np.sign(np.cross(plane.x, plane.y) @ plane.z)
    return replace(plane, x=side * np.cross(y, plane.z), y=y)


def image_degrees(directions: Floats, one: BoxMap) -> tuple[int, ...] | None:
    """Degrees of the image along directions (1 or 2, 3); None where it is not known to be a spline.

    Directions must have no component in common: then knot planes cut along parameter lines.
    """
    has = np.abs(one.frame.axes @ directions.T).T > _NONE
    if not has_pieces(one) or (has.sum(axis=0) > 1).any():
        return None
    degrees = [one.net_kind.degree(degree) for degree in one.degrees]
    found = tuple(int(np.array(degrees)[each].sum()) for each in has)
    return found if max(found) <= MOST_DEGREE else None


def compose(
    target: Target,
    values: Callable[[Floats], Floats],
    images: Callable[[Floats], Floats],
    size: float,
) -> Fit | None:
    """The spline of a target; None where it is not the image to rounding.

    Parameters
    ----------
    target : Target
        With the degrees and knots of the image.
    values : callable
        Images, or homogeneous images (n, 3 or 4), of points (n, 3).
    images : callable
        Images (n, 3) of points (n, 3).
    size : float, model length
        Size of the part.
    """
    fits = axis_fits(target)
    points = target.place(*open_grid([fit.sites for fit in fits]))
    known = values(points.reshape(-1, 3))
    poles = poles_of(target, fits, known.reshape(*points.shape[:-1], -1))
    at = unseen(target)
    found = evaluate(target.axes, poles, at)
    if poles.shape[-1] == 4:
        if poles[..., 3].min() <= 0:
            return None
        found = found[:, :3] / found[:, 3:]
    errors = np.linalg.norm(found - images(target.place(*at.T)), axis=1)
    error = float(errors.max(initial=0.0))
    return Fit(target.axes, poles, 0.0, len(errors)) if error <= _ROUNDING * size else None


def homogeneous_values(
    one: BoxMap, images: Callable[[Floats], Floats]
) -> Callable[[Floats], Floats]:
    """The function from points to images, homogeneous ones where a map is rational."""
    if not one.net_kind.rational:
        return images

    def values(points: Floats) -> Floats:
        local = np.clip(one.frame.to_local(points), one.box[0], one.box[1])
        weights = one.basis_matrix(local) @ one.net[..., 3].ravel()  # type: ignore[attr-defined]
        return np.concatenate([images(points) * weights[:, None], weights[:, None]], axis=1)

    return values
