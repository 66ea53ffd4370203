"""Boundary representations with their geometry indexed by face, edge and coedge."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import (
    CurveBatch,
    SurfaceBatch,
    curve_points,
    groups,
    surface_points,
    surface_positions,
)
from ffdcli.brep.readback import Pcurves, ReadBrep
from ffdcli.brep.record import Brep, Topology


@dataclass(frozen=True)
class Model:
    """A boundary representation ready to be evaluated.

    Parameters
    ----------
    read : ReadBrep
    faces : surfaces by face; a plane is a bilinear patch over the rectangle of its face's pcurves.
        A surface that several faces trim is repeated.
    curves : 3D curves by edge.
    pcurves : curves in surface parameters by coedge.
    """

    read: ReadBrep
    faces: tuple[SurfaceBatch, ...]
    curves: tuple[CurveBatch, ...]
    pcurves: tuple[CurveBatch, ...]

    @cached_property
    def face_at(self) -> tuple[Ints, Ints]:
        """(F,) batch and row of each face's surface, -1 where it has none."""
        return locate([batch.owners for batch in self.faces], self.read.face_count)

    @cached_property
    def curve_at(self) -> tuple[Ints, Ints]:
        """(E,) batch and row of each edge's curve, -1 where it has none."""
        return locate([batch.owners for batch in self.curves], len(self.read.edges))

    @cached_property
    def pcurve_at(self) -> tuple[Ints, Ints]:
        """(C,) batch and row of each coedge's pcurve, -1 where it has none."""
        return locate([batch.owners for batch in self.pcurves], len(self.read.coedge_edge))

    @cached_property
    def domain(self) -> Floats:
        """(F, 2, 2) lowest and highest surface parameters of every face's surface."""
        domain = np.zeros((self.read.face_count, 2, 2))
        for batch in self.faces:
            domain[batch.owners, :, 0] = batch.u_knots[:, [0, -1]]
            domain[batch.owners, :, 1] = batch.v_knots[:, [0, -1]]
        return domain

    def on_faces(self, face: Ints, uv: Floats) -> tuple[Floats, Floats]:
        """Evaluate faces' surfaces: points (n, 3) and tangents (n, 2, 3)."""
        points = np.full((len(face), 3), np.nan)
        tangents = np.full((len(face), 2, 3), np.nan)
        batch_of, row_of = self.face_at
        for number, part in groups(batch_of[face]):
            if number >= 0:
                points[part], tangents[part] = surface_points(
                    self.faces[number], row_of[face[part]], uv[part]
                )
        return points, tangents

    def positions_on_faces(self, face: Ints, uv: Floats) -> Floats:
        """The points of :meth:`on_faces` alone, sooner."""
        points = np.full((len(face), 3), np.nan)
        batch_of, row_of = self.face_at
        for number, part in groups(batch_of[face]):
            if number >= 0:
                rows = row_of[face[part]]
                points[part] = surface_positions(self.faces[number], rows, uv[part])
        return points

    def on_edges(self, edge: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Evaluate edges' curves: points (n, 3) and tangents (n, 1, 3)."""
        return _on_curves(self.curves, self.curve_at, edge, at, 3)

    def on_pcurves(self, coedge: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Evaluate coedges' pcurves: surface parameters (n, 2) and tangents (n, 1, 2)."""
        return _on_curves(self.pcurves, self.pcurve_at, coedge, at, 2)


def _on_curves(
    batches: tuple[CurveBatch, ...], where: tuple[Ints, Ints], owner: Ints, at: Floats, size: int
) -> tuple[Floats, Floats]:
    points = np.full((len(owner), size), np.nan)
    tangents = np.full((len(owner), 1, size), np.nan)
    batch_of, row_of = where
    for number, part in groups(batch_of[owner]):
        if number >= 0:
            points[part], tangents[part] = curve_points(
                batches[number], row_of[owner[part]], at[part]
            )
    return points, tangents


def locate(owners: list[Ints], count: int) -> tuple[Ints, Ints]:
    """List number and position of each owner, (count,) each; -1 for owners in no list."""
    batch_of = np.full(count, -1, dtype=np.int64)
    row_of = np.full(count, -1, dtype=np.int64)
    for number, owned in enumerate(owners):
        batch_of[owned] = number
        row_of[owned] = np.arange(len(owned))
    return batch_of, row_of


def model_of_read(read: ReadBrep) -> Model:
    """The model of a record read from a file."""
    curves = tuple(
        CurveBatch(c.edges, c.degree, c.knots, c.mults, c.poles, c.poles.shape[-1] == 4)
        for c in read.curves
    )
    pcurves = tuple(
        CurveBatch(p.coedges, p.degree, p.knots, p.mults, p.poles, p.poles.shape[-1] == 3)
        for p in read.pcurves
    )
    return Model(read, tuple(_face_surfaces(read, pcurves)), curves, pcurves)


def model_of_brep(brep: Brep) -> Model:
    """The model of an assembled record.

    Pcurves on B-spline surfaces are the record's straight segments, on planes the projected 3D
    curves.
    """
    shared = {field.name: getattr(brep, field.name) for field in fields(Topology)}
    return model_of_read(
        ReadBrep(
            **shared,
            edge_range=np.tile([0.0, 1.0], (len(brep.edges), 1)),
            pcurves=tuple(_pcurves(brep)),
            face_tolerance=np.zeros(brep.face_count),
        )
    )


def _pcurves(brep: Brep) -> list[Pcurves]:
    """Pcurves of all coedges of a record."""
    plane_of = _position(brep.planes.surfaces, brep.surface_count)
    plane = plane_of[brep.face_surface[brep.face_of_coedge]]
    straight = np.flatnonzero(plane < 0)
    made = []
    if len(straight):
        knots = np.tile([0.0, 1.0], (len(straight), 1))
        made.append(Pcurves(straight, 1, knots, np.array([2, 2]), brep.pcurves[straight]))
    flat = np.flatnonzero(plane >= 0)
    batch_of, row_of = locate([batch.edges for batch in brep.curves], len(brep.edges))
    for number, part in groups(batch_of[brep.coedge_edge[flat]]):
        if number < 0:
            continue
        batch, coedges = brep.curves[number], flat[part]
        rows, on = row_of[brep.coedge_edge[coedges]], plane[coedges]
        poles = batch.poles[rows]
        weight = poles[..., 3:] if poles.shape[-1] == 4 else np.ones_like(poles[..., :1])
        arm = poles[..., :3] - weight * brep.planes.origin[on][:, None]
        axes = np.stack([brep.planes.x_axis[on], brep.planes.y_axis[on]], axis=2)
        flattened = arm @ axes
        if poles.shape[-1] == 4:
            flattened = np.concatenate([flattened, weight], axis=2)
        made.append(Pcurves(coedges, batch.degree, batch.knots[rows], batch.mults, flattened))
    return made


def _face_surfaces(read: ReadBrep, pcurves: tuple[CurveBatch, ...]) -> list[SurfaceBatch]:
    """Surfaces of all faces."""
    count = read.surface_count
    made = []
    for batch in read.surfaces:
        row = _position(batch.surfaces, count)[read.face_surface]
        owners = np.flatnonzero(row >= 0)
        row = row[owners]
        made.append(
            SurfaceBatch(
                owners,
                batch.degrees,
                batch.u_knots[row],
                batch.v_knots[row],
                batch.u_mults,
                batch.v_mults,
                batch.poles[row],
                batch.poles.shape[-1] == 4,
            )
        )
    plane = _position(read.planes.surfaces, count)[read.face_surface]
    owners = np.flatnonzero(plane >= 0)
    if len(owners):
        plane = plane[owners]
        span = _pcurve_boxes(read, pcurves)[owners]
        side = np.stack([span[:, :, 0], span[:, :, 1]], axis=1)
        poles = (
            read.planes.origin[plane][:, None, None]
            + side[:, 0, :, None, None] * read.planes.x_axis[plane][:, None, None]
            + side[:, 1, None, :, None] * read.planes.y_axis[plane][:, None, None]
        )
        two = np.array([2, 2])
        made.append(SurfaceBatch(owners, (1, 1), side[:, 0], side[:, 1], two, two, poles, False))
    return [batch for batch in made if len(batch.owners)]


def _pcurve_boxes(read: ReadBrep, pcurves: tuple[CurveBatch, ...]) -> Floats:
    """(F, 2, 2) lowest and highest pcurve poles of every face; a unit square for none."""
    face = read.face_of_coedge
    low = np.full((read.face_count, 2), np.inf)
    high = np.full((read.face_count, 2), -np.inf)
    for batch in pcurves:
        poles = batch.poles[..., :2]
        if batch.rational:
            poles = poles / batch.poles[..., 2:]
        np.minimum.at(low, face[batch.owners], poles.min(axis=1))
        np.maximum.at(high, face[batch.owners], poles.max(axis=1))
    flat = ~(low < high)
    low[flat & ~np.isfinite(low)] = 0.0
    high[flat] = low[flat] + 1.0
    return np.stack([low, high], axis=1)


def _position(numbers: Ints, count: int) -> Ints:
    """(count,) position of each number in the list, -1 for numbers that are not listed."""
    position = np.full(count, -1, dtype=np.int64)
    used: Bools = numbers < count
    position[numbers[used]] = np.flatnonzero(used)
    return position
