"""Edits and their mirror images about a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.file.problems import AXES

# Points this close to the plane, or to a mirror image, relative to the size, lie on it.
NEAR = 1e-6


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane that edits are mirrored about.

    Parameters
    ----------
    point : (3,) float64, model length
    normal : (3,) float64
        Of length 1.
    """

    point: Floats
    normal: Floats

    @classmethod
    def of_axis(cls, axis: str, bounds: Floats) -> Plane:
        """The plane across the axis x, y or z through the middle of bounds (2, 3)."""
        return cls(np.asarray(bounds).mean(axis=0), np.eye(3)["xyz".index(axis)])

    def points(self, points: Floats) -> Floats:
        """Mirror images (..., 3) of points (..., 3)."""
        return np.asarray(points - 2 * self.distance(points)[..., None] * self.normal)

    def vectors(self, vectors: Floats) -> Floats:
        """Mirror images (..., 3) of vectors (..., 3)."""
        return np.asarray(vectors - 2 * (vectors @ self.normal)[..., None] * self.normal)

    def distance(self, points: Floats) -> Floats:
        """Distances (...) of points (..., 3) on the side that the normal points to."""
        return np.asarray((points - self.point) @ self.normal)


def mirrored_pairs(plane: Plane, points: Floats, by: Floats, size: float) -> tuple[Floats, Floats]:
    """Points of a drag with their mirror images, and the displacements of all.

    Points on the plane stay on it.
    """
    on = np.abs(plane.distance(points)) <= NEAR * size
    by = np.where(on[:, None], (by + plane.vectors(by)) / 2, by)
    both = np.concatenate([by, plane.vectors(by[~on])])
    return np.concatenate([points, plane.points(points[~on])]), both


@dataclass(frozen=True, eq=False)
class Halves:
    """Control points chosen on one side of a plane, their mirror images, and those on the plane."""

    near: Bools
    far: Bools
    on: Bools


def image_of(lattice: BoxLattice, plane: Plane) -> Ints:
    """(m,) number of the control point that mirrors each one, by their places at rest.

    Raises
    ------
    LatticeError
        The lattice is not symmetric about the plane.
    """
    from scipy.spatial import KDTree

    rest = lattice.control.at_rest
    places = rest.rest_points.reshape(-1, 3)
    images = lattice.map.frame.to_local(plane.points(lattice.map.frame.to_model(places)))
    levels = rest.levels.reshape(-1, 1) * 4 * np.ptp(places, axis=0).max()
    tree = KDTree(np.hstack([places, levels]))
    distance, found = tree.query(np.hstack([images, levels]))
    if distance.max() > NEAR * np.linalg.norm(np.ptp(places, axis=0)):
        message = "its control points are not symmetric about the plane"
        hint = "choose a plane through the middle of the lattice, or edit without symmetry"
        raise LatticeError(message, file=lattice.source.name, hint=hint)
    return np.asarray(found, dtype=np.int64)


def halves(lattice: BoxLattice, plane: Plane, mask: Bools) -> Halves:
    """A choice of control points made symmetric: what lies on the side that holds most of it."""
    image = image_of(lattice, plane)
    places = lattice.map.frame.to_model(lattice.control.at_rest.rest_points.reshape(-1, 3))
    distance = plane.distance(places)
    on = image == np.arange(len(image))
    side = np.sign(distance) * ~on
    near = 1.0 if (side[mask] > 0).sum() >= (side[mask] < 0).sum() else -1.0
    chosen = mask & (side == near)
    far = np.zeros_like(mask)
    far[image[chosen]] = True
    return Halves(chosen, far, mask & on)


def frame_reflection(lattice: BoxLattice, plane: Plane) -> Floats:
    """Reflection (3, 3) of vectors in the coordinates of the edits; columns are images of axes."""
    frame = lattice.map.frame
    return np.asarray(frame.axes @ plane.vectors(frame.axes).T)


def mirrored_transform(lattice: BoxLattice, plane: Plane, value: dict[str, Any]) -> dict[str, Any]:
    """A transformation of the mirror images of the control points.

    Raises
    ------
    LatticeError
        The plane is across none of the axes of the edits.
    """
    turn = frame_reflection(lattice, plane)
    across = np.flatnonzero(np.isclose(np.diag(turn), -1, atol=NEAR))
    if len(across) != 1:
        message = "the plane of symmetry must be across one of the axes of the lattice"
        raise LatticeError(message, file=lattice.source.name, hint="choose x, y or z")
    layout, frame = lattice.layout, lattice.map.frame
    origin = layout.written_origin
    centre = np.array(value.get("center") or layout.box.mean(axis=0) + origin)
    image = frame.to_local(plane.points(frame.to_model(centre - origin))) + origin
    out = dict(value)
    if not np.allclose(image, centre, rtol=0, atol=NEAR * float(np.ptp(layout.box, axis=0).max())):
        out["center"] = image.tolist()
    if out.get("rotate"):
        same = AXES.index(out["rotate"]["axis"]) == across[0]
        angle = out["rotate"]["angle"]
        out["rotate"] = {**out["rotate"], "angle": angle if same else -angle}
    if out.get("translate"):
        out["translate"] = (turn @ np.array(out["translate"])).tolist()
    return out
