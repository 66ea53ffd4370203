"""Planes and lines whose images are B-splines: of the degree of the composition, exact to rounding.

The image of a line is a spline whose knots are its crossings with the knot planes. So is that of a
plane where these planes cut it along its parameter lines. Their control points follow from values
of the deformation, since the space of splines is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.deformation import Deformation
from ffdcli.part.fit_target import (
    Fit,
    Images,
    Target,
    joined,
    parted,
    poles_of,
)
from ffdcli.part.surfaces import Plane
from ffdcli.volume.protocol import BoxMap

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


def parameters_in_box(plane: Plane, field: Deformation) -> Floats:
    """Bounds (2, 2) of a plane's parameters in the box of a field's one map.

    There are none at sides that the deformation ends at, nor where both parameters move a point
    along one axis.
    """
    one, bounds = field.maps[0], np.array([[-np.inf] * 2, [np.inf] * 2])
    along = one.frame.axes @ np.stack([plane.x, plane.y], axis=1)
    start = one.frame.to_local(plane.origin)
    sides = np.where(field.slack[0] > 0, one.box, np.array([[-np.inf], [np.inf]]))
    for axis, number in zip(*np.nonzero(np.abs(along) > _NONE), strict=True):
        if np.abs(along[axis, 1 - number]) <= _NONE:
            ends = np.sort((sides[:, axis] - start[axis]) / along[axis, number])
            bounds[0, number] = max(bounds[0, number], ends[0])
            bounds[1, number] = min(bounds[1, number], ends[1])
    return bounds


def image_degrees(directions: Floats, one: BoxMap, most: int) -> tuple[int, ...] | None:
    """Degrees of the image along directions (1 or 2, 3).

    None where it is not known to be a spline, or of a degree above the largest. Directions must
    have no component in common: then knot planes cut along parameter lines.
    """
    has = np.abs(one.frame.axes @ directions.T).T > _NONE
    if not has_pieces(one) or (has.sum(axis=0) > 1).any():
        return None
    degrees = [one.net_kind.degree(degree) for degree in one.degrees]
    found = tuple(int(np.array(degrees)[each].sum()) for each in has)
    return found if max(found) <= most else None


def compose(
    targets: Sequence[Target], images: Images, weights: Images, size: float
) -> list[Fit | None]:
    """The splines of targets; None for those that are not the image to rounding.

    Parameters
    ----------
    targets : sequence of Target
        With the degrees and knots of the image.
    images : callable
        Images (n, 3) of points (n, 3) of targets (n,).
    weights : callable
        The denominators (n,) of the images, 1 where these are polynomials.
    size : float, model length
        Size of the part.
    """
    points, owner = joined([target.grid for target in targets])
    below = weights(points, owner)[:, None]
    known = np.concatenate([images(points, owner) * below, below], axis=1)
    poles = [
        poles_of(target, values.reshape(*target.grid.shape[:-1], 4))
        for target, values in zip(targets, parted(known, owner, len(targets)), strict=True)
    ]
    points, owner = joined([target.unseen_points for target in targets])
    out: list[Fit | None] = []
    for target, net, wanted in zip(
        targets, poles, parted(images(points, owner), owner, len(targets)), strict=True
    ):
        found = target.at_unseen(net)
        error = np.linalg.norm(found[:, :3] / found[:, 3:] - wanted, axis=1).max(initial=0.0)
        good = error <= _ROUNDING * size and net[..., 3].min() > 0
        plain = np.abs(net[..., 3] - 1).max() <= _ROUNDING
        fit = Fit(target.axes, net[..., :3] if plain else net, 0.0, len(wanted))
        out.append(fit if good else None)
    return out
