"""The peak at a point of the object: what the control points that reach it have moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.site import EditSite
from ffdcli.volume.weights import rational_basis

# Least height of a peak relative to the displacements of its control points: else they cancel.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Peak:
    """The peak at a point of the object.

    Parameters
    ----------
    place : (3,) float64, lattice frame
        The point.
    functions : (nu, nv, nw) or (n,) float64
        Values of the polynomial basis functions there.
    members : (nu, nv, nw) or (n,) bool
        Control points that reach the point, are free, and are displaced.
    base : (3,) float64
        Displacement of the image of the point with the members at rest.
    lift : (3,) float64
        Further displacement by the members.
    """

    place: Floats
    functions: Floats
    members: Bools
    base: Floats
    lift: Floats

    @property
    def along(self) -> Floats:
        """(3,) unit direction of the peak."""
        return np.asarray(self.lift / np.linalg.norm(self.lift))

    @property
    def height(self) -> float:
        """Distance of the image from the point, along the direction of the peak."""
        return float(self.along @ (self.base + self.lift))


def place_of(lattice: BoxLattice, point: tuple[float, float, float], site: EditSite) -> Floats:
    """Place (3,) of a point of the object in the lattice frame.

    Raises
    ------
    LatticeError
        Nothing moves there, or the point has no parameters.
    """
    place = lattice.layout.frame.to_local(np.array(point))
    if not lattice.start.contains(place[None])[0]:
        message = "the point lies outside the lattice box, where nothing moves"
        raise site.source.error(("point",), message, "choose a point inside it")
    if not lattice.start.has_parameters(place[None])[0]:
        message = "the point has no parameters in the volume at rest"
        raise site.source.error(("point",), message, "choose a point of the mesh")
    return place


def find_peak(lattice: BoxLattice, place: Floats) -> Peak | None:
    """The peak at a place (3,); None if no free control point that reaches it has moved it."""
    rest, points, weights = lattice.control.at_rest, lattice.points, lattice.weights
    basis = rest.basis_matrix(place[None])
    functions = basis.toarray().reshape(weights.shape)
    displaced = np.any(points != rest.rest_points, axis=-1)
    members = (functions > 0) & displaced & lattice.free
    if not members.any():
        return None
    flat = np.where(members[..., None], rest.rest_points, points)
    base = rest.with_control(flat, weights).evaluate(place[None])[0] - place
    moves = np.where(members[..., None], points - rest.rest_points, 0.0).reshape(-1, 3)
    lift = np.asarray(rational_basis(basis, weights.ravel()) @ moves)[0]
    if np.linalg.norm(lift) <= _NOTHING * np.linalg.norm(moves, axis=1).max():
        return None
    return Peak(place, functions, members, base, lift)


def no_peak(site: EditSite) -> LatticeError:
    """The error of an edit that needs a peak where there is none."""
    message = "there is no peak: no control point that reaches the point has moved it"
    return site.source.error(("point",), message, "raise one first, as with `hammer`")
