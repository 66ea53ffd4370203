"""The deformation of a part: new geometry on the same topology and the same parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError
from ffdcli.lattice import Lattice
from ffdcli.part.curves import Curve
from ffdcli.part.new_geometry import (
    EXACT,
    UNCHANGED,
    Limits,
    Made,
    exact_edges,
    exact_faces,
    fit_edges,
    fit_faces,
)
from ffdcli.part.prepared import PreparedPart
from ffdcli.part.reach import Reached, find_reached
from ffdcli.part.record import Part
from ffdcli.part.surfaces import BSplineSurface, Plane, Surface
from ffdcli.part.tolerances import new_tolerances

# Default tolerance of fits, as a share of the part's size; edges keep within half of it.
DEFAULT_TOLERANCE = 1e-5
# Smallest tolerance, as a share of the size: rounding errors are some 1e-15 of it.
_LEAST = 1e-11
# Degrees of fits, and the share of the size below which the higher one is taken. On five parts in
# tricubic lattices quintic fits took 1.23 times the control points of cubic ones at 1e-4 of the
# size, 0.90 at 1e-5, 0.83 at 1e-6 and 0.58 at 1e-7. All programs read cubics.
CUBIC, QUINTIC, _FINE = 3, 5, 5e-6
# Largest degree of exact images; beyond it fits take fewer control points.
_MOST_DEGREE = 9
_NAMES = ("unchanged", "exact", "fitted")


@dataclass(frozen=True, eq=False)
class DeformedPart:
    """A part with its new geometry.

    Parameters
    ----------
    part : Part
        As it was read; its topology and pcurves hold.
    surfaces : (F,) tuple of Surface or None
        None where the surface stays as it was read.
    planes : (F,) tuple of Plane or None
        The plane of a planar face with the parameters that its new surface has; None where these
        are the parameters as read. Its axes are not unit where the image is a plane. Curves on such
        faces follow from the curves of their edges.
    curves : (E,) tuple of Curve or None
        None where the curve stays as it was read, or there is none.
    edge_range : (E, 2) float64
        As read, except on lines between planes.
    points : (V, 3) float64, model length
    face_kinds, edge_kinds, vertex_kinds : (F,), (E,), (V,) int64
        ``UNCHANGED``, ``EXACT`` or ``FITTED``.
    face_bounds, edge_bounds : (F,), (E,) float64, model length
        Stated bounds of the distance from the deformation, at the same parameters; 0 unless
        fitted.
    face_errors, edge_errors : (F,), (E,) float64, model length
        Largest distances found.
    edge_tolerance, vertex_tolerance : (E,), (V,) float64, model length
    mirrored : (S,) bool
        Shells that the lattice mirrors: their faces are turned, so that they look outwards.
    samples : int
        Points at which the errors were measured.
    """

    part: Part
    surfaces: tuple[Surface | None, ...]
    planes: tuple[Plane | None, ...]
    curves: tuple[Curve | None, ...]
    edge_range: Floats
    points: Floats
    face_kinds: Ints
    edge_kinds: Ints
    vertex_kinds: Ints
    face_bounds: Floats
    edge_bounds: Floats
    face_errors: Floats
    edge_errors: Floats
    edge_tolerance: Floats
    vertex_tolerance: Floats
    mirrored: Bools
    samples: int

    @property
    def max_error(self) -> float:
        """The stated bound of all faces and edges, model length."""
        return float(max(self.face_bounds.max(initial=0.0), self.edge_bounds.max(initial=0.0)))

    @property
    def control_points(self) -> int:
        """Number of control points of the new surfaces."""
        made = [each for each in self.surfaces if isinstance(each, BSplineSurface)]
        return sum(each.poles[..., 0].size for each in made)

    @property
    def report(self) -> dict[str, Any]:
        """Shares, errors and tolerances, for the report."""

        def largest(*values: Floats) -> float:
            return float(np.concatenate(values).max(initial=0.0))

        return {
            "faces": _counts(self.face_kinds),
            "edges": _counts(self.edge_kinds),
            "vertices": _counts(self.vertex_kinds),
            "max_error": self.max_error,
            "samples": self.samples,
            "control_points": self.control_points,
            "largest_tolerance": {
                "read": largest(self.part.edge_tolerance, self.part.vertex_tolerance),
                "written": largest(self.edge_tolerance, self.vertex_tolerance),
            },
        }


def _counts(kinds: Ints) -> dict[str, int]:
    return {name: int((kinds == number).sum()) for number, name in enumerate(_NAMES)}


def deform_part(
    part: Part | PreparedPart,
    lattice: Lattice,
    tolerance: float | None = None,
    max_degree: int | None = None,
) -> DeformedPart:
    """Deform a part.

    Parameters
    ----------
    part : Part or PreparedPart
    lattice : Lattice
        Settled by the part. All lattices that a prepared part is deformed by have the same basis.
    tolerance : float, optional, model length
        Of fitted faces; edges keep within half of it. 1e-5 of the part's size by default.
    max_degree : int, optional
        Largest degree of new surfaces and curves; 3 at least. What is kept as it was read, or
        mapped by an affine map, keeps its degree.

    Raises
    ------
    LatticeError
        The tolerance is not a positive length, or smaller than rounding allows.
    CheckError
        A face or edge cannot be fitted within the tolerance.
    """
    prepared = part if isinstance(part, PreparedPart) else PreparedPart(part)
    limits = limits_for(prepared.part, tolerance, max_degree)
    return _assembled(prepared, lattice, *_fitted(prepared, lattice, limits))


def begin_with_knots(
    prepared: PreparedPart, lattice: Lattice, tolerance: float | None = None
) -> None:
    """Let fits begin with the knots that those of a lattice need."""
    for made in _fitted(prepared, lattice, limits_for(prepared.part, tolerance, None)):
        prepared.targets.update((each.key, each.target) for each in made.asked.values())


def count_kinds(
    prepared: PreparedPart, lattice: Lattice, tolerance: float | None, max_degree: int | None
) -> dict[str, dict[str, int]]:
    """Numbers of faces and edges by how they will be made, found without fitting any."""
    limits = limits_for(prepared.part, tolerance, max_degree)
    faces = exact_faces(prepared, lattice, limits)
    edges = exact_edges(prepared, lattice, faces, limits)
    return {"faces": _counts(faces.kinds), "edges": _counts(edges.kinds)}


def limits_for(part: Part, tolerance: float | None, max_degree: int | None) -> Limits:
    """The limits of new geometry, from the options of :func:`deform_part`."""
    allowed = DEFAULT_TOLERANCE * part.size if tolerance is None else tolerance
    if not 0 < allowed < np.inf:
        raise LatticeError(f"the fit tolerance must be a positive length, not {allowed:g}")
    if allowed < _LEAST * part.size:
        raise LatticeError(
            f"{allowed:.3g} is less than coordinates of a part of size {part.size:.3g} can keep to",
            hint=f"give a --fit-tolerance of {_LEAST * part.size:.1g} or more",
        )
    most = _MOST_DEGREE if max_degree is None else max_degree
    degree = CUBIC if allowed >= _FINE * part.size else QUINTIC
    return Limits(allowed, min(degree, most), most)


def _fitted(prepared: PreparedPart, lattice: Lattice, limits: Limits) -> tuple[Made, Made]:
    """All faces and all edges."""
    faces = exact_faces(prepared, lattice, limits)
    edges = exact_edges(prepared, lattice, faces, limits)
    return fit_faces(prepared.part, faces, limits), fit_edges(edges, limits)


def _assembled(prepared: PreparedPart, lattice: Lattice, faces: Made, edges: Made) -> DeformedPart:
    """The deformed part, with vertices and tolerances."""
    part = prepared.part
    at, points = _move_vertices(prepared, lattice, edges)
    edge_tolerance, vertex_tolerance = new_tolerances(part, at, edges, faces)
    return DeformedPart(
        part=part,
        surfaces=faces.geometry,
        planes=faces.planes,
        curves=edges.geometry,
        edge_range=edges.ranges,
        points=points,
        face_kinds=faces.kinds,
        edge_kinds=edges.kinds,
        vertex_kinds=np.where(at.identity, UNCHANGED, EXACT),
        face_bounds=faces.bounds,
        edge_bounds=edges.bounds,
        face_errors=faces.errors,
        edge_errors=edges.errors,
        edge_tolerance=edge_tolerance,
        vertex_tolerance=vertex_tolerance,
        mirrored=_mirrored(part, Deformation.of(lattice, part.delta)),
        samples=faces.samples + edges.samples,
    )


def _move_vertices(prepared: PreparedPart, lattice: Lattice, edges: Made) -> tuple[Reached, Floats]:
    """What reaches the vertices, and their images."""
    part = prepared.part
    found = find_reached(lattice, prepared.vertex_cover, part.size)
    identity = found.identity.copy()
    ends = part.edges[edges.kinds == UNCHANGED].ravel()
    identity[ends[ends >= 0]] = True
    moved = found.images(part.points, np.arange(len(part.points)))
    points = np.where(identity[:, None], part.points, moved)
    return replace(found, identity=identity), points


def _mirrored(part: Part, deformation: Deformation) -> Bools:
    """(S,) whether the lattice mirrors each shell, by most of the vertices of its edges."""
    shell = np.repeat(part.face_shell[part.face_of_coedge], 2)
    vertex = part.edges[part.coedge_edge].ravel()
    known = vertex >= 0
    if not known.any():
        return np.zeros(len(part.shell_closed), dtype=bool)
    slopes = deformation.jacobian(part.points)
    sense = np.sign(np.linalg.det(slopes))[vertex[known]]
    return np.bincount(shell[known], sense, minlength=len(part.shell_closed)) < 0
