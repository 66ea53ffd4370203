"""The deformation of a part: new geometry on the same topology and the same parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import LatticeError
from ffdcli.lattice import Lattice
from ffdcli.part.affine_images import AffineMap, affine_curve, affine_surface, line_as_spline
from ffdcli.part.breaks import planes_of
from ffdcli.part.composed import compose, homogeneous_values, image_degrees, turned_plane
from ffdcli.part.cover import cover_edges, cover_faces, cover_points
from ffdcli.part.curves import Curve, Line
from ffdcli.part.fit import Fit, Images, Target, fit_all
from ffdcli.part.outline import Outline, outline_on_plane, outlines_of
from ffdcli.part.reach import Reached, find_reached
from ffdcli.part.record import Part
from ffdcli.part.surfaces import BSplineSurface, Plane, Surface
from ffdcli.part.targets import (
    DEGREE,
    curve_target,
    fitted_curve,
    fitted_surface,
    surface_target,
)

# Default tolerance of fits, as a share of the part's size; edges keep within half of it.
DEFAULT_TOLERANCE = 1e-5
# How an item was made.
UNCHANGED, EXACT, FITTED = range(3)
_NAMES = ("unchanged", "exact", "fitted")
# Samples along an edge for the stretch of the deformation.
_STRETCH = 9


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
        are the parameters as read. Curves on such faces follow from the curves of their edges.
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

        counts = {
            items: {name: int((kinds == number).sum()) for number, name in enumerate(_NAMES)}
            for items, kinds in (
                ("faces", self.face_kinds),
                ("edges", self.edge_kinds),
                ("vertices", self.vertex_kinds),
            )
        }
        return {
            **counts,
            "max_error": self.max_error,
            "samples": self.samples,
            "control_points": self.control_points,
            "largest_tolerance": {
                "read": largest(self.part.edge_tolerance, self.part.vertex_tolerance),
                "written": largest(self.edge_tolerance, self.vertex_tolerance),
            },
        }


def deform_part(part: Part, lattice: Lattice, tolerance: float | None = None) -> DeformedPart:
    """Deform a part.

    Parameters
    ----------
    part : Part
    lattice : Lattice
        Settled by the part.
    tolerance : float, optional, model length
        Of fitted faces; edges keep within half of it. 1e-5 of the part's size by default.

    Raises
    ------
    LatticeError
        The tolerance is not a positive length.
    CheckError
        A face or edge cannot be fitted within the tolerance.
    """
    allowed = DEFAULT_TOLERANCE * part.size if tolerance is None else tolerance
    if not 0 < allowed < np.inf:
        raise LatticeError(f"the fit tolerance must be a positive length, not {allowed:g}")
    faces = _deform_faces(part, lattice, allowed)
    edges = _deform_edges(part, lattice, faces, allowed / 2)
    at, points = _move_vertices(part, lattice, edges)
    edge_tolerance, vertex_tolerance = _tolerances(part, at, edges, faces)
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
        samples=faces.samples + edges.samples,
    )


@dataclass(frozen=True, eq=False)
class _Made:
    """New geometry of all faces or all edges.

    Parameters
    ----------
    reached : Reached
    geometry : (n,) tuple of Surface, Curve or None
    kinds : (n,) int64
    bounds, errors : (n,) float64, model length
    samples : int
    ranges : (n, 2) float64
        Of edges.
    planes : (n,) tuple of Plane or None
        Of faces: planes whose parameters the new surface has.
    """

    reached: Reached
    geometry: tuple[Any, ...]
    kinds: Ints
    bounds: Floats
    errors: Floats
    samples: int
    ranges: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    planes: tuple[Plane | None, ...] = ()


def _deform_faces(part: Part, lattice: Lattice, tolerance: float) -> _Made:
    """New surfaces of all faces."""
    outlines, size = outlines_of(part), part.size
    reached = find_reached(lattice, cover_faces(part, outlines), size)
    kinds = np.where(reached.identity, UNCHANGED, FITTED)
    geometry: list[Surface | None] = [None] * part.face_count
    for face in np.flatnonzero(reached.affine & ~reached.identity).tolist():
        by = AffineMap(reached.matrix[face], reached.offset[face])
        geometry[face] = affine_surface(part.surfaces[face], part.rectangles[face], by)
        if geometry[face] is not None:
            kinds[face] = EXACT
    sheets = {
        face: _sheet(part, face, outlines[face], reached)
        for face in np.flatnonzero(kinds == FITTED).tolist()
    }
    breaks = planes_of(lattice)

    def target(face: int, degrees: tuple[int, int] = (DEGREE, DEGREE)) -> Target:
        surface, rectangle, outline = sheets[face]
        return surface_target(surface, rectangle, outline, breaks, size, degrees)

    for face, (surface, rectangle, _) in sheets.items():
        one = reached.map_of(face)
        if one is None or not isinstance(surface, Plane):
            continue
        degrees = image_degrees(np.stack([surface.x, surface.y]), one)
        fit = degrees and _compose(target(face, (degrees[0], degrees[1])), face, reached, size)
        if fit:
            geometry[face], kinds[face] = fitted_surface(fit, rectangle), EXACT
    rest = np.flatnonzero(kinds == FITTED)
    targets = [target(face) for face in rest.tolist()]
    fits = fit_all(targets, _images_of(reached, rest), tolerance, "face", rest)
    for face, fit in zip(rest.tolist(), fits, strict=True):
        geometry[face] = fitted_surface(fit, sheets[face][1])
    planes: list[Plane | None] = [None] * part.face_count
    for face, (surface, _, _) in sheets.items():
        if isinstance(surface, Plane) and surface is not part.surfaces[face]:
            planes[face] = surface
    made = _made(reached, geometry, kinds, fits)
    return replace(made, planes=tuple(planes))


def _sheet(
    part: Part, face: int, outline: Outline, reached: Reached
) -> tuple[Surface, Floats, Outline]:
    """The surface of a face that is to be fitted, the rectangle and the outline of its parameters.

    Planes are turned so that knot planes cut them along parameter lines.
    """
    surface, one = part.surfaces[face], reached.map_of(face)
    if one is not None and isinstance(surface, Plane):
        turned = turned_plane(surface, one)
        found = None if turned is surface else outline_on_plane(part, face, turned)
        if found is not None:
            return turned, *found
    return surface, part.rectangles[face], outline


def _compose(target: Target, item: int, reached: Reached, size: float) -> Fit | None:
    """The exact image of a plane or line."""
    one = reached.map_of(item)
    assert one is not None

    def images(points: Floats) -> Floats:
        return reached.images(points, np.full(len(points), item))

    return compose(target, homogeneous_values(one, images), images, size)


def _deform_edges(part: Part, lattice: Lattice, faces: _Made, tolerance: float) -> _Made:
    """New curves of all edges."""
    count, size = len(part.curves), part.size
    found = find_reached(lattice, cover_edges(part), size)
    reached = _share_maps(found, faces.reached, part)
    kinds = np.where(reached.identity, UNCHANGED, FITTED)
    kinds[part.degenerate & ~reached.identity] = EXACT
    geometry: list[Curve | None] = [None] * count
    ranges = part.edge_range.copy()
    planar = np.array(
        [
            isinstance(surface, Plane) and (kind == UNCHANGED or isinstance(made, Plane))
            for surface, kind, made in zip(
                part.surfaces, faces.kinds.tolist(), faces.geometry, strict=True
            )
        ],
        dtype=bool,
    )
    free = np.ones(count, dtype=bool)
    free[part.coedge_edge[~planar[part.face_of_coedge]]] = False
    for edge in np.flatnonzero(reached.affine & (kinds == FITTED)).tolist():
        curve, ends = part.curves[edge], part.edge_range[edge]
        by = AffineMap(reached.matrix[edge], reached.offset[edge])
        geometry[edge] = None if curve is None else affine_curve(curve, by)
        if geometry[edge] is None and isinstance(curve, Line):
            along = by.vectors(curve.direction)
            length = float(np.linalg.norm(along))
            if free[edge]:
                geometry[edge] = Line(by.points(curve.origin), along / length)
                ranges[edge] = ends * length
            else:
                geometry[edge] = line_as_spline(Line(by.points(curve.origin), along), *ends)
        if geometry[edge] is not None:
            kinds[edge] = EXACT
    breaks = planes_of(lattice)

    def target(edge: int, degree: int = DEGREE) -> Target:
        curve = part.curves[edge]
        assert curve is not None
        return curve_target(curve, part.edge_range[edge], breaks, size, degree)

    for edge in np.flatnonzero(kinds == FITTED).tolist():
        curve, one = part.curves[edge], reached.map_of(edge)
        if one is None or not isinstance(curve, Line):
            continue
        degrees = image_degrees(curve.direction[None], one)
        fit = degrees and _compose(target(edge, degrees[0]), edge, reached, size)
        if fit:
            geometry[edge], kinds[edge] = fitted_curve(fit, part.edge_range[edge]), EXACT
    rest = np.flatnonzero(kinds == FITTED)
    targets = [target(edge) for edge in rest.tolist()]
    fits = fit_all(targets, _images_of(reached, rest), tolerance, "edge", rest)
    for edge, fit in zip(rest.tolist(), fits, strict=True):
        geometry[edge] = fitted_curve(fit, part.edge_range[edge])
    return replace(_made(reached, geometry, kinds, fits), ranges=ranges)


def _made(
    reached: Reached,
    geometry: list[Any],
    kinds: Ints,
    fits: tuple[Fit, ...],
) -> _Made:
    """The record of all items, fitted ones with their errors."""
    bounds, errors = np.zeros((2, len(kinds)))
    bounds[kinds == FITTED] = [fit.bound for fit in fits]
    errors[kinds == FITTED] = [fit.error for fit in fits]
    samples = sum(fit.samples for fit in fits)
    return _Made(reached, tuple(geometry), kinds, bounds, errors, samples)


def _images_of(reached: Reached, items: Ints) -> Images:
    """The deformation of chosen items, by their number among these."""

    def images(points: Floats, number: Ints) -> Floats:
        return reached.images(points, items[number])

    return images


def _share_maps(edges: Reached, faces: Reached, part: Part) -> Reached:
    """Give edges the affine map of a face that they bound, as they lie in that face too.

    Edges between cells would else be asked about one of these cells only.
    """
    identity, affine = edges.identity.copy(), edges.affine.copy()
    matrix, offset = edges.matrix.copy(), edges.offset.copy()
    face, edge = part.face_of_coedge, part.coedge_edge
    for known in (faces.affine, faces.identity):
        chosen = np.flatnonzero(known[face])
        matrix[edge[chosen]] = faces.matrix[face[chosen]]
        offset[edge[chosen]] = faces.offset[face[chosen]]
        affine[edge[chosen]] = True
    identity[edge[faces.identity[face]]] = True
    return replace(edges, identity=identity, affine=affine, matrix=matrix, offset=offset)


def _move_vertices(part: Part, lattice: Lattice, edges: _Made) -> tuple[Reached, Floats]:
    """What reaches the vertices, and their images."""
    found = find_reached(lattice, cover_points(part.points), part.size)
    identity = found.identity.copy()
    ends = part.edges[edges.kinds == UNCHANGED].ravel()
    identity[ends[ends >= 0]] = True
    moved = found.images(part.points, np.arange(len(part.points)))
    points = np.where(identity[:, None], part.points, moved)
    return replace(found, identity=identity), points


def _tolerances(part: Part, vertices: Reached, edges: _Made, faces: _Made) -> tuple[Floats, Floats]:
    """Tolerances of edges and of vertices.

    An edge's: as it was read times the stretch there, its curve's bound, and the largest bound of
    its faces. A vertex's: the same of the vertex, and no less than its edges'. None falls below
    what was read.
    """
    beside = np.zeros(len(part.curves))
    np.maximum.at(beside, part.coedge_edge, faces.bounds[part.face_of_coedge])
    edge_tolerance = part.edge_tolerance * _edge_stretch(part, edges) + edges.bounds + beside
    slopes = vertices.stretch(part.points, np.arange(len(part.points)))
    own = part.vertex_tolerance * np.where(vertices.identity, 1.0, np.maximum(slopes, 1.0))
    around = np.zeros(len(own))
    most = np.zeros(len(own))
    for end in part.edges.T:
        known = end >= 0
        np.maximum.at(around, end[known], (edges.bounds + beside)[known])
        np.maximum.at(most, end[known], edge_tolerance[known])
    return edge_tolerance, np.maximum(own + around, most)


def _edge_stretch(part: Part, edges: _Made) -> Floats:
    """(E,) largest factor by which lengths grow along each edge, 1 at least."""
    out = np.ones(len(part.curves))
    shares = np.linspace(0, 1, _STRETCH)
    moved = [
        edge
        for edge in np.flatnonzero(edges.kinds != UNCHANGED).tolist()
        if part.curves[edge] is not None
    ]
    if moved:
        ends = part.edge_range[moved]
        at = ends[:, :1] + shares * (ends[:, 1:] - ends[:, :1])
        points = [part.curves[edge].points(t) for edge, t in zip(moved, at, strict=True)]  # type: ignore[union-attr]
        found = edges.reached.stretch(np.concatenate(points), np.repeat(moved, _STRETCH))
        out[moved] = np.maximum(found.reshape(-1, _STRETCH).max(axis=1), 1.0)
    return out
