"""New surfaces and curves for the faces and edges of a part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import CheckError
from ffdcli.lattice import Lattice
from ffdcli.part.affine_images import (
    AffineMap,
    affine_curve,
    affine_surface,
    line_as_spline,
    plane_before,
)
from ffdcli.part.breaks import planes_of
from ffdcli.part.composed import compose, image_degrees, parameters_in_box, turned_plane
from ffdcli.part.curves import Curve, Line
from ffdcli.part.fit import fit_all
from ffdcli.part.fit_target import Fit, Images, Target
from ffdcli.part.outline import Outline, clip_outline, turned_outline
from ffdcli.part.prepared import PreparedPart, TargetKey
from ffdcli.part.reach import Reached, find_reached
from ffdcli.part.record import Part
from ffdcli.part.surfaces import Plane, Surface
from ffdcli.part.targets import curve_target, fitted_curve, fitted_surface, surface_target

# How an item was made.
UNCHANGED, EXACT, FITTED = range(3)
# Width of a face in its parameters that is none, as a share of these.
_WIDTH = 1e-9


@dataclass(frozen=True)
class Limits:
    """What new geometry must keep to.

    Parameters
    ----------
    tolerance : float, model length
        Of fitted faces; edges keep within half of it.
    degree : int
        Of what is fitted.
    most_degree : int
        Of exact images; what would be higher is fitted.
    """

    tolerance: float
    degree: int
    most_degree: int


class Asked(NamedTuple):
    """A face or an edge that is to be fitted.

    Parameters
    ----------
    key : TargetKey
    target : Target
    ends : (2, 2) or (2,) float64
        Parameters at the ends of its shares.
    """

    key: TargetKey
    target: Target
    ends: Floats


@dataclass(frozen=True, eq=False)
class Made:
    """New geometry of all faces or all edges.

    Parameters
    ----------
    reached : Reached
    geometry : (n,) tuple of Surface, Curve or None
    kinds : (n,) int64
    ranges : (n, 2) float64
        Of edges.
    planes : (n,) tuple of Plane or None
        Of faces: planes whose parameters the new surface has.
    asked : dict of int to Asked
        What has no exact form. Before the fit it has no geometry; after it its target has the
        knots of the fit.
    fits : dict of int to Fit
    """

    reached: Reached
    geometry: tuple[Any, ...]
    kinds: Ints
    ranges: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    planes: tuple[Plane | None, ...] = ()
    asked: dict[int, Asked] = field(default_factory=dict)
    fits: dict[int, Fit] = field(default_factory=dict)

    @property
    def bounds(self) -> Floats:
        """(n,) stated bounds of the errors, model length; 0 unless fitted."""
        return self._of_fits("bound")

    @property
    def errors(self) -> Floats:
        """(n,) largest distances found, model length; 0 unless fitted."""
        return self._of_fits("error")

    @property
    def samples(self) -> int:
        """Number of points at which the errors were measured."""
        return sum(fit.samples for fit in self.fits.values())

    def _of_fits(self, name: str) -> Floats:
        out = np.zeros(len(self.kinds))
        out[list(self.fits)] = [getattr(fit, name) for fit in self.fits.values()]
        return out


def exact_faces(prepared: PreparedPart, lattice: Lattice, limits: Limits) -> Made:
    """Faces that keep their surface, and exact images; the others have no new surface yet."""
    part, outlines, size = prepared.part, prepared.outlines, prepared.part.size
    reached = find_reached(lattice, prepared.face_cover, size)
    kinds = np.where(reached.identity, UNCHANGED, FITTED)
    geometry: list[Surface | None] = [None] * part.face_count
    planes: list[Plane | None] = [None] * part.face_count
    for face in np.flatnonzero(reached.affine & ~reached.identity).tolist():
        by = AffineMap(reached.matrix[face], reached.offset[face])
        old = part.surfaces[face]
        new = geometry[face] = affine_surface(old, part.rectangles[face], by)
        if new is not None:
            kinds[face] = EXACT
        if isinstance(old, Plane) and isinstance(new, Plane):
            planes[face] = plane_before(old, new, by)
    sheets = {
        face: _sheet(part, face, outlines[face], reached)
        for face in np.flatnonzero(kinds == FITTED).tolist()
    }
    breaks = planes_of(lattice)
    sides = tuple(each.sides for each in breaks)

    def ask(face: int, degrees: tuple[int, int]) -> Asked:
        surface, rectangle, outline = sheets[face]
        key = "face", face, degrees, sides

        def make() -> Target:
            return surface_target(surface, rectangle, outline, breaks, size, degrees)

        return Asked(key, prepared.target(key, make), rectangle)

    tried = {}
    for face, (surface, _, _) in sheets.items():
        one = reached.map_of(face)
        if one is not None and isinstance(surface, Plane):
            degrees = image_degrees(np.stack([surface.x, surface.y]), one, limits.most_degree)
            if degrees:
                tried[face] = ask(face, (degrees[0], degrees[1]))
    for face, fit in _composed(tried, reached, size):
        geometry[face], kinds[face] = fitted_surface(fit, sheets[face][1]), EXACT
    rest = np.flatnonzero(kinds == FITTED).tolist()
    asked = {face: ask(face, (limits.degree, limits.degree)) for face in rest}
    for face, (surface, _, _) in sheets.items():
        if isinstance(surface, Plane) and surface is not part.surfaces[face]:
            planes[face] = surface
    return Made(reached, tuple(geometry), kinds, planes=tuple(planes), asked=asked)


def fit_faces(part: Part, made: Made, limits: Limits) -> Made:
    """The same with the surfaces that are to be fitted."""
    names = [part.named_face(face) for face in made.asked]
    return _fitted(made, fitted_surface, limits.tolerance, names)


def fit_edges(made: Made, limits: Limits) -> Made:
    """Edges with the curves that are to be fitted."""
    names = [f"edge {edge + 1}" for edge in made.asked]
    return _fitted(made, fitted_curve, limits.tolerance / 2, names)


def _fitted(
    made: Made, build: Callable[[Fit, Floats], Any], tolerance: float, names: list[str]
) -> Made:
    """All that is asked, fitted within a tolerance."""
    items, geometry = list(made.asked), list(made.geometry)
    targets = [each.target for each in made.asked.values()]
    found = fit_all(
        targets, _images_of(made.reached, np.array(items, dtype=np.int64)), tolerance, names
    )
    fits = dict(zip(items, found, strict=True))
    asked = {}
    for item, (key, target, ends) in made.asked.items():
        geometry[item] = build(fits[item], ends)
        asked[item] = Asked(key, replace(target, axes=fits[item].axes), ends)
    return replace(made, geometry=tuple(geometry), fits=fits, asked=asked)


def _sheet(
    part: Part, face: int, outline: Outline, reached: Reached
) -> tuple[Surface, Floats, Outline]:
    """The surface of a face that is to be fitted, the rectangle and the outline of its parameters.

    Planes are turned so that knot planes cut them along parameter lines, and end where the lattice
    does, beyond which the deformation is no longer the same polynomial.

    Raises
    ------
    CheckError
        The face has no width in its parameters.
    """
    low, high = part.rectangles[face]
    if (high - low <= _WIDTH * np.abs(part.rectangles[face]).max()).any():
        raise CheckError(
            f"face {face + 1} has no area, so that its outline has no width",
            hint="delete the face in the program that made the part",
        )
    surface, rectangle, one = part.surfaces[face], part.rectangles[face], reached.map_of(face)
    if one is None or not isinstance(surface, Plane):
        return surface, rectangle, outline
    turned = turned_plane(surface, one)
    if turned is not surface:
        found = turned_outline(outline, rectangle, surface, turned)
        if found is not None:
            surface, rectangle, outline = turned, *found
    bounds = parameters_in_box(surface, reached.fields[reached.field[face]])
    return surface, *clip_outline(outline, rectangle, bounds)


def _composed(tried: dict[int, Asked], reached: Reached, size: float) -> list[tuple[int, Fit]]:
    """Exact images of planes or lines, by number, of those that have one."""
    items = np.array(list(tried), dtype=np.int64)

    def weights(points: Floats, number: Ints) -> Floats:
        return reached.denominators(points, items[number])

    targets = [each.target for each in tried.values()]
    fits = compose(targets, _images_of(reached, items), weights, size)
    return [(item, fit) for item, fit in zip(tried, fits, strict=True) if fit is not None]


def exact_edges(prepared: PreparedPart, lattice: Lattice, faces: Made, limits: Limits) -> Made:
    """Edges that keep their curve, and exact images; the others have no new curve yet."""
    part = prepared.part
    count, size = len(part.curves), part.size
    found = find_reached(lattice, prepared.edge_cover, size)
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
    sides = tuple(each.sides for each in breaks)

    def ask(edge: int, degree: int) -> Asked:
        curve, ends = part.curves[edge], part.edge_range[edge]
        assert curve is not None
        key = "edge", edge, (degree,), sides
        target = prepared.target(key, lambda: curve_target(curve, ends, breaks, size, degree))
        return Asked(key, target, ends)

    tried = {}
    for edge in np.flatnonzero(kinds == FITTED).tolist():
        curve, one = part.curves[edge], reached.map_of(edge)
        if one is not None and isinstance(curve, Line):
            degrees = image_degrees(curve.direction[None], one, limits.most_degree)
            if degrees:
                tried[edge] = ask(edge, degrees[0])
    for edge, fit in _composed(tried, reached, size):
        geometry[edge], kinds[edge] = fitted_curve(fit, part.edge_range[edge]), EXACT
    asked = {edge: ask(edge, limits.degree) for edge in np.flatnonzero(kinds == FITTED).tolist()}
    return Made(reached, tuple(geometry), kinds, ranges, asked=asked)


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
