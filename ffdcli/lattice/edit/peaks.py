"""Hammer and crimp: change the height of a peak but not its shape, and the reverse.

The peak at a point of the object is made by the displacements of the control points that reach
it (after the tools of Noble & Clapworthy, which Song & Yang 2005, section 6, adopt). With these
control points at rest the image of the point is ``b``; their displacements add ``s d``, where s
scales all of them equally.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import lsmr

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.drag_edit import solve_drag
from ffdcli.lattice.edit.hammer_weights import hammered_weights
from ffdcli.lattice.edit.peak import find_peak, no_peak, place_of
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.drag_models import DragOptions
from ffdcli.lattice.file.edit_models import Crimp, Hammer
from ffdcli.volume.weights import rational_basis

# Relative residual at which the least-squares solution counts as found.
_SOLVED = 1e-12
# Length of the mean of unit normals below which they cancel.
_CANCELLED = 1e-9


def hammer_peak(lattice: BoxLattice, edit: Hammer, site: EditSite) -> BoxLattice:
    """Give a peak another height; where nothing has moved yet, raise one along the normal.

    The height is the distance of the image from the point, along the direction of the peak.
    """
    place = place_of(lattice, edit.point, site)
    peak = find_peak(lattice, place)
    if edit.by == "weights":
        if peak is None:
            raise no_peak(site)
        weights = hammered_weights(lattice, peak, edit.height, site)
        return lattice.with_points(lattice.points, weights)
    if peak is not None:
        scale = (edit.height - float(peak.base @ peak.along)) / float(np.linalg.norm(peak.lift))
        rest, points = lattice.control.at_rest.rest_points, lattice.points
        moved = np.where(peak.members[..., None], rest + scale * (points - rest), points)
        return lattice.with_points(moved, lattice.weights)
    normal = lattice.layout.frame.turn_to_model(outward_normal(site.surface, place))
    if not normal.any():
        message = "the sides of the mesh that are nearest to this point face all ways: they give a "
        raise site.source.error(
            ("point",), f"{message}peak no direction", "choose a point on the surface"
        )
    pairs = PairTable(
        np.array([edit.point]), edit.height * normal[None], np.array([True]), np.ones(1)
    )
    try:
        done = solve_drag(lattice, pairs, DragOptions(), site.source, lambda _: ())
    except LatticeError as error:
        hint = "choose a point that free control points reach, or more `points`"
        raise site.source.error((), error.message, hint) from None
    return lattice.with_points(done.points, lattice.weights)


def crimp_peak(lattice: BoxLattice, edit: Crimp, site: EditSite) -> BoxLattice:
    """Make a peak sharper or fuller by the weights of its control points, at the same height.

    The weight of a control point is multiplied by ``k = 1 - (1 - 1 / sharpness) c`` and its
    displacement by ``1 / k``, where c is its basis function at the point over the largest one.
    The numerators of the peak stay the same, so its profile is divided by the weighted mean of k
    at each place over that at the point, which is monotone in the sharpness.
    """
    peak = find_peak(lattice, place_of(lattice, edit.point, site))
    if peak is None:
        raise no_peak(site)
    if edit.sharpness == 1:
        return lattice
    rest, points, place = lattice.control.at_rest, lattice.points, peak.place[None]
    share = np.where(lattice.free, peak.functions, 0.0) / peak.functions[lattice.free].max()
    factor = 1 - (1 - 1 / edit.sharpness) * share
    weights, members = factor * lattice.weights, peak.members[..., None]
    flat = np.where(members, rest.rest_points, points)
    held = flat + _holding(lattice, flat, weights, peak.along)
    moves = np.where(members, (points - rest.rest_points) / factor[..., None], 0.0)
    base, whole = (
        float((rest.with_control(net, weights).evaluate(place)[0] - peak.place) @ peak.along)
        for net in (held, held + moves)
    )
    scale = (peak.height - base) / (whole - base)
    return lattice.with_points(held + scale * moves, weights)


def _holding(lattice: BoxLattice, flat: Floats, weights: Floats, along: Floats) -> Floats:
    """Displacements of free control points, across the peak, that hold the object in place.

    Weights alone would draw it sideways, away from lighter control points, and widen the peak.
    With ``flat`` as control points the map stays as it is, across the direction ``along``, at the
    rest points that the changed weights reach; as nearly as the free ones among them can make it.
    """
    rest = lattice.control.at_rest
    sites = rest.rest_points.reshape(-1, 3)
    usable = np.flatnonzero(rest.contains(sites))
    usable = usable[rest.has_parameters(sites[usable])]
    basis = rest.basis_matrix(sites[usable])
    reached = basis @ (weights != lattice.weights).ravel().astype(np.float64) > 0
    sites, usable = sites[usable[reached]], usable[reached]
    columns = usable[lattice.free.ravel()[usable]]
    matrix = rational_basis(basis[reached], weights.ravel())[:, columns]
    before, after = (
        rest.with_control(flat, each).evaluate(sites) for each in (lattice.weights, weights)
    )
    across = np.linalg.svd(along[None])[2][1:]
    missing = (before - after) @ across.T
    found = [lsmr(matrix, each, atol=_SOLVED, btol=_SOLVED)[0] for each in missing.T]
    held = np.zeros((weights.size, 3))
    held[columns] = np.column_stack(found) @ across
    return held.reshape(flat.shape)


def outward_normal(triangles: Floats, place: Floats) -> Floats:
    """Unit normal (3,) of the triangle (T, 3, 3) nearest to a place (3,).

    The mean of the normals if several are equally near, as at a vertex; 0 where they cancel.
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
    size = float(np.linalg.norm(mean))
    return np.asarray(mean / size if size > _CANCELLED * np.count_nonzero(near) else 0 * mean)
