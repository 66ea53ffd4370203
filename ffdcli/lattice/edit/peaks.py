"""Hammer and crimp: change the height of a peak but not its shape, and the reverse.

The peak at a point of the object is made by the displacements of the control points that reach
it (after the tools of Noble & Clapworthy, which Song & Yang 2005, section 6, adopt). With these
control points at rest the image of the point is ``b``; their displacements add ``s d``, where s
scales all of them equally.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.drag_edit import solve_drag
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.drag_models import DragOptions
from ffdcli.lattice.file.edit_models import Crimp, Hammer
from ffdcli.volume.weights import rational_basis

# Least height of a peak relative to the displacements of its control points: else they cancel.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Peak:
    """The peak at a point of the object.

    Parameters
    ----------
    members : (nu, nv, nw) or (n,) bool
        Control points that reach the point, are free, and are displaced.
    base : (3,) float64
        Displacement of the image of the point with the members at rest.
    lift : (3,) float64
        Further displacement by the members.
    """

    members: Bools
    base: Floats
    lift: Floats


def hammer_peak(lattice: BoxLattice, edit: Hammer, site: EditSite) -> BoxLattice:
    """Give a peak another height; where nothing has moved yet, raise one along the normal.

    The height is the distance of the image from the point, along the direction of the peak.
    """
    place, peak = _find_peak(lattice, edit.point, site)
    if peak is not None:
        length = float(np.linalg.norm(peak.lift))
        scale = (edit.height - float(peak.base @ peak.lift) / length) / length
        return _stretched(lattice, peak.members, scale, lattice.weights)
    normal = lattice.layout.frame.turn_to_model(outward_normal(site.surface, place))
    pairs = PairTable(np.array([edit.point]), edit.height * normal[None], np.array([True]))
    try:
        done = solve_drag(lattice, pairs, DragOptions(), site.source, lambda _: ())
    except LatticeError as error:
        hint = "choose a point that free control points reach, or more `points`"
        raise site.source.error((), error.message, hint) from None
    return lattice.with_points(done.points, lattice.weights)


def crimp_peak(lattice: BoxLattice, edit: Crimp, site: EditSite) -> BoxLattice:
    """Make a peak fuller or sharper by the weights of its control points, at the same height."""
    place, peak = _find_peak(lattice, edit.point, site)
    if peak is not None:
        along = peak.lift / np.linalg.norm(peak.lift)
        height = float(along @ (peak.base + peak.lift))
        heavier = np.where(peak.members, edit.sharpness * lattice.weights, lattice.weights)
        again = _measure(lattice, heavier, place, peak.members)
        # With the new weights the peak may vanish.
        if again and abs(float(again.lift @ along)) >= _NOTHING * np.linalg.norm(again.lift):
            scale = (height - float(again.base @ along)) / float(again.lift @ along)
            return _stretched(lattice, peak.members, scale, heavier)
    message = "there is no peak: no control point that reaches the point has moved it"
    raise site.source.error(("point",), message, "raise one first, as with `hammer`")


def _find_peak(
    lattice: BoxLattice, point: tuple[float, float, float], site: EditSite
) -> tuple[Floats, Peak | None]:
    """Place (3,) of a point of the object in the lattice frame, and the peak there.

    None if no control point that reaches the place is displaced, or they cancel.
    """
    place = lattice.layout.frame.to_local(np.array(point))
    if not lattice.start.contains(place[None])[0]:
        message = "the point lies outside the lattice box, where nothing moves"
        raise site.source.error(("point",), message, "choose a point inside it")
    if not lattice.start.has_parameters(place[None])[0]:
        message = "the point has no parameters in the volume at rest"
        raise site.source.error(("point",), message, "choose a point of the mesh")
    rest = lattice.control.at_rest
    reaches = np.zeros(lattice.weights.size, dtype=bool)
    basis = rest.basis_matrix(place[None])
    reaches[basis.indices[basis.data > 0]] = True
    moved = np.any(lattice.points != rest.rest_points, axis=-1)
    members = reaches.reshape(lattice.weights.shape) & moved & lattice.free
    return place, _measure(lattice, lattice.weights, place, members)


def _measure(lattice: BoxLattice, weights: Floats, place: Floats, members: Bools) -> Peak | None:
    if not members.any():
        return None
    rest, points = lattice.control.at_rest, lattice.points
    flat = np.where(members[..., None], rest.rest_points, points)
    base = rest.with_control(flat, weights).evaluate(place[None])[0] - place
    moves = np.where(members[..., None], points - rest.rest_points, 0.0).reshape(-1, 3)
    lift = np.asarray(rational_basis(rest.basis_matrix(place[None]), weights.ravel()) @ moves)[0]
    if np.linalg.norm(lift) <= _NOTHING * np.linalg.norm(moves, axis=1).max():
        return None
    return Peak(members, base, lift)


def _stretched(lattice: BoxLattice, members: Bools, scale: float, weights: Floats) -> BoxLattice:
    rest, points = lattice.control.at_rest.rest_points, lattice.points
    moved = np.where(members[..., None], rest + scale * (points - rest), points)
    return lattice.with_points(moved, weights)


def outward_normal(triangles: Floats, place: Floats) -> Floats:
    """Unit normal (3,) of the triangle (T, 3, 3) nearest to a place (3,).

    The mean of the normals if several are equally near, as at a vertex.
    """
    distance = np.full(len(triangles), np.inf)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(length, np.finfo(float).tiny)[:, None]
    inside = length > 0
    for i in range(3):
        start, side = triangles[:, i], triangles[:, (i + 1) % 3] - triangles[:, i]
        arm = place - start
        square = np.maximum((side * side).sum(axis=1), np.finfo(float).tiny)
        share = np.clip((arm * side).sum(axis=1) / square, 0, 1)
        away = np.linalg.norm(arm - share[:, None] * side, axis=1)
        distance = np.minimum(distance, away)
        inside &= (np.cross(side, arm) * normals).sum(axis=1) >= 0
    height = np.abs(((place - triangles[:, 0]) * normals).sum(axis=1))
    distance = np.where(inside, height, distance)
    extent = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    near = distance <= distance.min() + 1e-9 * extent
    mean = normals[near].sum(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), np.finfo(float).tiny))
