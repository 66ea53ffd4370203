"""OpenCascade shapes as plain arrays, without repairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.occ.reading.splines import SplineBatch, curve_splines
from ffdcli.brep.occ.reading.surfaces import (
    plane_batch,
    read_surface,
    surface_batches,
    surface_numbers,
)
from ffdcli.brep.readback import Pcurves, ReadBrep
from ffdcli.brep.record import Curves, Planes

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


@dataclass
class _Found:
    """Flat lists that the walk over a shape fills."""

    faces: list[Any] = field(default_factory=list)
    face_reversed: list[bool] = field(default_factory=list)
    face_shell: list[int] = field(default_factory=list)
    shell_closed: list[bool] = field(default_factory=list)
    shell_solid: list[int] = field(default_factory=list)
    solids: int = 0


def extract(shape: TopoDS_Shape, surface_of: dict[Any, Any] | None = None) -> ReadBrep:
    """The record of a shape.

    Parameters
    ----------
    shape : TopoDS_Shape
        Solids, shells or faces, alone or in compounds.
    surface_of : dict, optional
        As in :class:`~ffdcli.brep.occ.reading.loading.ReadModel`.

    Returns
    -------
    ReadBrep

    Raises
    ------
    KernelError
        A face or edge has geometry other than planes, lines, Bézier and B-spline curves and
        surfaces; the message names the face or edge.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    forward = TopAbs_Orientation.TopAbs_FORWARD
    found = _Found()
    _walk(shape, found, solid=-1)

    edge_map = TopTools_IndexedMapOfShape()
    face_surface = surface_numbers(found.faces, surface_of or {})
    surfaces: list[Any] = []
    face_loops, loop_coedges = [0], [0]
    coedge_edge: list[int] = []
    coedge_forward: list[bool] = []
    # Curves of the coedges of B-spline faces, with face and edge; and the coedges of planes.
    pcurves: dict[int, Any] = {}
    users: dict[int, tuple[Any, Any]] = {}
    flat: list[int] = []
    face_tolerance = []
    for number, (shape_face, turned) in enumerate(
        zip(found.faces, found.face_reversed, strict=True)
    ):
        face = TopoDS.Face_s(shape_face.Oriented(forward))
        if face_surface[number] == len(surfaces):
            surfaces.append(read_surface(face, number))
        is_plane = isinstance(surfaces[face_surface[number]], np.ndarray)
        face_tolerance.append(BRep_Tool.Tolerance_s(face))
        for wire in _children(face):
            # OpenCascade's wires run about the surface's normal, loops about the outward normal.
            children = list(_children(wire))
            backward = _is_reversed(wire) != turned
            for child in reversed(children) if backward else children:
                coedge = len(coedge_edge)
                coedge_edge.append(edge_map.Add(child) - 1)
                coedge_forward.append(_is_reversed(child) == turned)
                if is_plane:
                    flat.append(coedge)
                    continue
                edge = TopoDS.Edge_s(child)
                pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
                if pcurve is not None:
                    pcurves[coedge] = pcurve
                    users[coedge] = edge, face
            loop_coedges.append(len(coedge_edge))
        face_loops.append(len(loop_coedges) - 1)

    curves, ends, ranges, edge_tolerance, points, vertex_tolerance = _edges(edge_map)
    planes = plane_batch(surfaces)
    in_surfaces = curve_splines(
        pcurves,
        2,
        lambda coedge: BRep_Tool.Range_s(*users[coedge]),
        lambda coedge: f"the pcurve of edge {coedge_edge[coedge]}",
    )
    in_planes = _in_planes(
        curves,
        np.array(flat, dtype=np.int64),
        np.array(coedge_edge, dtype=np.int64),
        np.repeat(face_surface, np.diff(np.array(loop_coedges)[face_loops])),
        planes,
    )
    return ReadBrep(
        points=points,
        edges=ends,
        edge_range=ranges,
        curves=tuple(Curves(*_members(batch)) for batch in curves),
        surfaces=surface_batches(surfaces),
        planes=planes,
        face_surface=np.array(face_surface, dtype=np.int64),
        face_reversed=np.array(found.face_reversed, dtype=bool),
        face_loops=np.array(face_loops),
        loop_coedges=np.array(loop_coedges),
        coedge_edge=np.array(coedge_edge, dtype=np.int64),
        coedge_forward=np.array(coedge_forward, dtype=bool),
        pcurves=tuple(Pcurves(*_members(batch)) for batch in (*in_surfaces, *in_planes)),
        face_shell=np.array(found.face_shell, dtype=np.int64),
        shell_closed=np.array(found.shell_closed, dtype=bool),
        shell_solid=np.array(found.shell_solid, dtype=np.int64),
        face_tolerance=np.array(face_tolerance),
        edge_tolerance=edge_tolerance,
        vertex_tolerance=vertex_tolerance,
    )


def _children(shape: Any) -> Iterator[Any]:
    """Parts of a shape, with orientation and location within it."""
    from OCP.TopoDS import TopoDS_Iterator

    iterator = TopoDS_Iterator(shape)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()


def _is_reversed(shape: Any) -> bool:
    from OCP.TopAbs import TopAbs_Orientation

    return bool(shape.Orientation() == TopAbs_Orientation.TopAbs_REVERSED)


def _walk(shape: Any, found: _Found, solid: int) -> None:
    """Collect the faces of a shape with shells, solids and total orientations."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    kind = shape.ShapeType()
    if kind == Kind.TopAbs_FACE:
        # A face outside shells gets its own shell.
        _add_shell(found, [shape], closed=False, solid=-1)
    elif kind == Kind.TopAbs_SHELL:
        _add_shell(found, list(_children(shape)), closed=BRep_Tool.IsClosed_s(shape), solid=solid)
    elif kind == Kind.TopAbs_SOLID:
        found.solids += 1
        for child in _children(shape):
            _walk(child, found, solid=found.solids - 1)
    elif kind in (Kind.TopAbs_COMPOUND, Kind.TopAbs_COMPSOLID):
        for child in _children(shape):
            _walk(child, found, solid=-1)


def _add_shell(found: _Found, faces: list[Any], *, closed: bool, solid: int) -> None:
    number = len(found.shell_solid)
    found.shell_closed.append(bool(closed))
    found.shell_solid.append(solid)
    for face in faces:
        found.faces.append(face)
        found.face_reversed.append(_is_reversed(face))
        found.face_shell.append(number)


def _edges(
    edge_map: Any,
) -> tuple[list[SplineBatch], Ints, Floats, Floats, Floats, Floats]:
    """Curves, end vertices, ranges and tolerances of the edges; points and tolerances of those."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    vertex_map = TopTools_IndexedMapOfShape()
    curves: dict[int, Any] = {}
    count = edge_map.Extent()
    ends = np.full((count, 2), -1)
    ranges = np.zeros((count, 2))
    tolerances = np.zeros(count)
    for number in range(count):
        shape = edge_map.FindKey(number + 1).Oriented(TopAbs_Orientation.TopAbs_FORWARD)
        edge = TopoDS.Edge_s(shape)
        for side, vertex in enumerate((TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge))):
            if not vertex.IsNull():
                ends[number, side] = vertex_map.Add(vertex) - 1
        tolerances[number] = BRep_Tool.Tolerance_s(edge)
        curve = BRep_Tool.Curve_s(edge, 0.0, 1.0)
        if curve is not None:
            curves[number] = curve
            ranges[number] = BRep_Tool.Range_s(edge)
    vertices = [TopoDS.Vertex_s(vertex_map.FindKey(i + 1)) for i in range(vertex_map.Extent())]
    points = np.array([BRep_Tool.Pnt_s(vertex).Coord() for vertex in vertices]).reshape(-1, 3)
    vertex_tolerances = np.array([BRep_Tool.Tolerance_s(vertex) for vertex in vertices])
    splines = curve_splines(curves, 3, lambda edge: ranges[edge], lambda edge: f"edge {edge}")
    return splines, ends, ranges, tolerances, points, vertex_tolerances


def _in_planes(
    curves: list[SplineBatch], flat: Ints, coedge_edge: Ints, coedge_surface: Ints, planes: Planes
) -> Iterator[SplineBatch]:
    """Space curves of the coedges ``flat`` of planes, in their planes' coordinates."""
    plane = np.searchsorted(planes.surfaces, coedge_surface[flat])
    for batch in curves:
        row = np.searchsorted(batch.numbers, coedge_edge[flat])
        row = np.minimum(row, len(batch.numbers) - 1)
        mine = np.flatnonzero(batch.numbers[row] == coedge_edge[flat])
        if not len(mine):
            continue
        row, on = row[mine], plane[mine]
        poles = batch.poles[row]
        weights = poles[..., 3:] if poles.shape[-1] == 4 else np.ones_like(poles[..., :1])
        arm = poles[..., :3] - weights * planes.origin[on][:, None]
        poles = np.concatenate(
            [arm @ np.stack([planes.x_axis[on], planes.y_axis[on]], axis=2), poles[..., 3:]], axis=2
        )
        yield replace(batch, numbers=flat[mine], knots=(batch.knots[0][row],), poles=poles)


def _members(batch: SplineBatch) -> tuple[Ints, int, Floats, Ints, Floats]:
    """Numbers, degree, knots, multiplicities and poles of a batch of curves."""
    return batch.numbers, batch.degrees[0], batch.knots[0], batch.mults[0], batch.poles
