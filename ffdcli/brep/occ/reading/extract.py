"""OpenCascade shapes as plain arrays, without repairs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.occ.reading.surfaces import (
    homogeneous,
    plane_batch,
    read_surface,
    surface_batches,
    surface_numbers,
)
from ffdcli.brep.readback import Pcurves, ReadBrep
from ffdcli.brep.record import Curves
from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Degree, multiplicities, knots, poles.
_Spline = tuple[int, tuple[int, ...], list[float], Floats]


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
    # Curves of the coedges of B-spline faces, and the coedges of planes.
    pcurves: dict[int, _Spline] = {}
    flat: list[tuple[int, int]] = []
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
                    flat.append((coedge, number))
                    continue
                edge = TopoDS.Edge_s(child)
                pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
                if pcurve is not None:
                    first, last = BRep_Tool.Range_s(edge, face)
                    pcurves[coedge] = _spline(
                        pcurve, first, last, f"the pcurve of edge {coedge_edge[-1]}"
                    )
            loop_coedges.append(len(coedge_edge))
        face_loops.append(len(loop_coedges) - 1)

    splines, ends, ranges, edge_tolerance, points, vertex_tolerance = _edges(edge_map)
    for coedge, number in flat:
        spline = splines.get(coedge_edge[coedge])
        if spline is not None:
            pcurves[coedge] = _in_plane(spline, surfaces[face_surface[number]])
    return ReadBrep(
        points=points,
        edges=ends,
        edge_range=ranges,
        curves=tuple(Curves(*batch) for batch in _batches(splines)),
        surfaces=surface_batches(surfaces),
        planes=plane_batch(surfaces),
        face_surface=np.array(face_surface, dtype=np.int64),
        face_reversed=np.array(found.face_reversed, dtype=bool),
        face_loops=np.array(face_loops),
        loop_coedges=np.array(loop_coedges),
        coedge_edge=np.array(coedge_edge, dtype=np.int64),
        coedge_forward=np.array(coedge_forward, dtype=bool),
        pcurves=tuple(Pcurves(*batch) for batch in _batches(pcurves)),
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


def _spline(curve: Any, first: float, last: float, what: str) -> _Spline:
    """Return a 2D or 3D line, Bézier or B-spline curve as a B-spline."""
    kind = type(curve).__name__.rsplit("_", 1)[-1]
    if kind == "TrimmedCurve":
        curve = curve.BasisCurve()
        kind = type(curve).__name__.rsplit("_", 1)[-1]
    if kind == "Line":
        return 1, (2, 2), [first, last], np.array([curve.Value(t).Coord() for t in (first, last)])
    if kind not in ("BSplineCurve", "BezierCurve"):
        raise KernelError(f"{what} is neither a line nor a B-spline: {kind}")
    if kind == "BSplineCurve":
        if curve.IsPeriodic():
            curve = curve.Copy()
            curve.SetNotPeriodic()
        ends = curve.Multiplicity(1), curve.Multiplicity(curve.NbKnots())
        if min(ends) <= curve.Degree():
            curve = curve.Copy()
            curve.Segment(curve.FirstParameter(), curve.LastParameter())
    pole = curve.Pole
    count = range(1, curve.NbPoles() + 1)
    poles = np.array([pole(i).Coord() for i in count])
    if curve.IsRational():
        poles = homogeneous(poles, np.array([curve.Weight(i) for i in count]))
    degree = curve.Degree()
    if kind == "BezierCurve":
        return degree, (degree + 1, degree + 1), [0.0, 1.0], poles
    breaks = range(1, curve.NbKnots() + 1)
    mults = tuple(curve.Multiplicity(i) for i in breaks)
    return degree, mults, [curve.Knot(i) for i in breaks], poles


def _edges(
    edge_map: Any,
) -> tuple[dict[int, _Spline], Any, Floats, Floats, Floats, Floats]:
    """Curves, end vertices, ranges and tolerances of the edges; points and tolerances of those."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    vertex_map = TopTools_IndexedMapOfShape()
    splines: dict[int, _Spline] = {}
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
            first, last = ranges[number] = BRep_Tool.Range_s(edge)
            splines[number] = _spline(curve, first, last, f"edge {number}")
    vertices = [TopoDS.Vertex_s(vertex_map.FindKey(i + 1)) for i in range(vertex_map.Extent())]
    points = np.array([BRep_Tool.Pnt_s(vertex).Coord() for vertex in vertices]).reshape(-1, 3)
    vertex_tolerances = np.array([BRep_Tool.Tolerance_s(vertex) for vertex in vertices])
    return splines, ends, ranges, tolerances, points, vertex_tolerances


def _in_plane(spline: _Spline, plane: Floats) -> _Spline:
    """Project a space curve on a plane, in the plane's coordinates."""
    degree, mults, knots, poles = spline
    origin, axes = plane[0], plane[1:]
    if poles.shape[1] == 3:
        return degree, mults, knots, (poles - origin) @ axes.T
    weights = poles[:, 3:]
    flat = (poles[:, :3] - weights * origin) @ axes.T
    return degree, mults, knots, np.concatenate([flat, weights], axis=1)


def _batches(splines: dict[int, _Spline]) -> Iterator[tuple[Any, int, Floats, Any, Floats]]:
    """Group curves by degree, multiplicities and shape of the poles."""
    groups: dict[Any, list[int]] = defaultdict(list)
    for number, (degree, mults, _, poles) in splines.items():
        groups[degree, mults, poles.shape].append(number)
    for (degree, mults, _), numbers in sorted(groups.items()):
        yield (
            np.array(numbers),
            degree,
            np.array([splines[number][2] for number in numbers]),
            np.array(mults),
            np.array([splines[number][3] for number in numbers]),
        )
