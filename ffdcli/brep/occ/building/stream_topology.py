"""Vertices, edges, wires, faces, shells and solids as records of OpenCascade's binary stream."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.brep.occ.building.pcurve_uses import CoedgeUses, Pairs
from ffdcli.brep.occ.building.stream_geometry import BYTE, INT, REAL, Records, fill, lengths
from ffdcli.brep.record import Brep

# Kinds of shapes.
_COMPOUND, _SOLID, _SHELL, _FACE, _WIRE, _EDGE, _VERTEX = 0, 2, 3, 4, 5, 6, 7
# Free, modified, checked, orientable, closed, infinite, convex.
_FLAGS = [("flags", BYTE, 7)]
_PART = np.dtype([("reversed", BYTE), ("number", INT), ("place", INT)])
_END = [("end", BYTE)]
_END_OF_PARTS = ord("*")
# Geometry of an edge: its curve, a pcurve, or two pcurves on a surface that meets itself.
_CURVE, _PCURVE, _SEAM = 1, 2, 3


class ShapeNumbers:
    """Place of every shape in the stream: vertices, edges, wires, faces, shells, solids.

    Solids, and shells of no solid, are parts of a compound if there are several of them.
    """

    def __init__(self, brep: Brep) -> None:
        self.vertex = np.arange(len(brep.points))
        # Edges, wires and faces are numbered in the order in which their records are written.
        self.edge = np.zeros(len(brep.edges), dtype=np.int64)
        self.wire = np.zeros(len(brep.loop_coedges) - 1, dtype=np.int64)
        self.face = np.zeros(brep.face_count, dtype=np.int64)
        sizes = [len(each) for each in (self.vertex, self.edge, self.wire, self.face)]
        starts = np.cumsum([0, *sizes, len(brep.shell_closed), brep.solid_count])
        self.first_edge, self.first_wire, self.first_face = starts[1:4].tolist()
        self.shell = starts[4] + np.arange(len(brep.shell_closed))
        self.solid = starts[5] + np.arange(brep.solid_count)
        self.roots = np.concatenate([self.solid, self.shell[brep.shell_solid < 0]])
        self.count = int(starts[6]) + (len(self.roots) != 1)

    def parts(self, shapes: Ints, reverse: Bools) -> Records:
        """References to shapes as parts of others."""
        parts = np.zeros(shapes.shape, dtype=_PART)
        parts["reversed"], parts["number"] = reverse, self.count - shapes
        return parts


def _flags(*, free: bool = False, closed: bool | Bools = False, convex: bool = False) -> Ints:
    """Flags of a shape: modified and orientable, and those given."""
    closed = np.asarray(closed)
    flags = np.zeros((*closed.shape, 7), dtype=np.int64)
    flags[..., 0], flags[..., 1], flags[..., 3] = free, True, True
    flags[..., 4], flags[..., 6] = closed, convex
    return flags


def vertex_records(brep: Brep) -> Records:
    """The records of all vertices."""
    layout = [
        ("kind", BYTE),
        ("tolerance", REAL),
        ("point", REAL, 3),
        ("no_curves", BYTE),
        *_FLAGS,
        *_END,
    ]
    return fill(
        layout,
        len(brep.points),
        kind=_VERTEX,
        tolerance=brep.vertex_tolerance,
        point=brep.points,
        flags=_flags(closed=True, convex=True),
        end=_END_OF_PARTS,
    )


def edge_records(
    brep: Brep,
    shapes: ShapeNumbers,
    coedges: CoedgeUses,
    pairs: Pairs,
    curve_number: Ints,
    surface_number: Ints,
) -> Iterator[Records]:
    """Yield the records of edges, grouped by the kinds of their pcurves, and number them."""
    ends = np.ones(len(brep.edges))
    if coedges.straight.any():
        for batch in brep.curves:
            lines = coedges.straight[batch.edges]
            # Rational curves are not lines.
            if lines.any():
                ends[batch.edges[lines]] = lengths(
                    np.diff(batch.poles[lines][:, [0, -1]], axis=1)[:, 0]
                )
    uses = np.bincount(pairs.edge, minlength=len(brep.edges))
    first = np.cumsum(uses) - uses
    kinds = np.zeros((len(brep.edges), int(uses.max(initial=0))), dtype=np.int64)
    kinds[pairs.edge, np.arange(len(pairs.edge)) - first[pairs.edge]] = np.where(
        pairs.seam, _SEAM, _PCURVE
    )
    before = shapes.first_edge
    patterns, pattern_of = np.unique(kinds, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        edges = np.flatnonzero(pattern_of.ravel() == number)
        shapes.edge[edges] = before + np.arange(len(edges))
        before += len(edges)
        used = pattern[pattern > 0]
        layout = [
            ("kind", BYTE),
            ("tolerance", REAL),
            ("same", BYTE, 2),
            ("degenerated", BYTE),
            ("is_curve", BYTE),
            ("curve", INT),
            ("place", INT),
            ("range", REAL, 2),
            *((f"pcurve{i}", _pcurve_layout(int(kind))) for i, kind in enumerate(used)),
            ("no_more", BYTE),
            *_FLAGS,
            ("vertices", _PART, 2),
            *_END,
        ]
        span = np.column_stack([np.zeros(len(edges)), ends[edges]])
        records = fill(
            layout,
            len(edges),
            kind=_EDGE,
            tolerance=brep.edge_tolerance[edges],
            same=True,
            is_curve=_CURVE,
            curve=curve_number[edges],
            range=span,
            flags=_flags(),
            vertices=shapes.parts(shapes.vertex[brep.edges[edges]], np.array([False, True])),
            end=_END_OF_PARTS,
        )
        for i, kind in enumerate(used):
            pair = first[edges] + i
            field = records[f"pcurve{i}"]
            field["kind"] = kind
            field["pcurve"] = pairs.pcurve[pair]
            if kind == _SEAM:
                field["second"] = pairs.pcurve[pair] + 1
            field["surface"] = surface_number[pairs.surface[pair]]
            field["range"] = span
        yield records


def _pcurve_layout(kind: int) -> list[tuple[str, str] | tuple[str, str, tuple[int, ...]]]:
    """Layout of one pcurve of an edge; a seam has a second one, and a continuity (0: C0)."""
    seam = [("second", INT), ("continuity", BYTE)] if kind == _SEAM else []
    return [
        ("kind", BYTE),
        ("pcurve", INT),
        *seam,
        ("surface", INT),
        ("place", INT),
        ("range", REAL, (2,)),
    ]


def _runs(starts: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield owners grouped by the number of their items, and the items (n, count)."""
    counts = np.diff(starts)
    for count in np.unique(counts).tolist():
        owners = np.flatnonzero(counts == count)
        yield owners, starts[owners, None] + np.arange(count)


def wire_records(brep: Brep, shapes: ShapeNumbers) -> Iterator[Records]:
    """Yield the records of wires, grouped by their number of edges, and number them."""
    loop_turned = brep.face_reversed[brep.face_of_loop]
    before = shapes.first_wire
    for loops, coedges in _runs(brep.loop_coedges):
        shapes.wire[loops] = before + np.arange(len(loops))
        before += len(loops)
        # OpenCascade's wires run about the surface's normal, loops about the outward normal.
        turned = loop_turned[loops, None]
        coedges = np.where(turned, coedges[:, ::-1], coedges)
        forward = brep.coedge_forward[coedges] != turned
        edges = shapes.parts(shapes.edge[brep.coedge_edge[coedges]], ~forward)
        layout = [("kind", BYTE), *_FLAGS, ("edges", _PART, coedges.shape[1]), *_END]
        yield fill(
            layout,
            len(loops),
            kind=_WIRE,
            flags=_flags(closed=True),
            edges=edges,
            end=_END_OF_PARTS,
        )


def face_records(brep: Brep, shapes: ShapeNumbers, surface_number: Ints) -> Iterator[Records]:
    """Yield the records of faces, grouped by their number of wires, and number them."""
    tolerance = float(brep.edge_tolerance.min(initial=np.inf))
    before = shapes.first_face
    for faces, loops in _runs(brep.face_loops):
        shapes.face[faces] = before + np.arange(len(faces))
        before += len(faces)
        layout = [
            ("kind", BYTE),
            ("whole_surface", BYTE),
            ("tolerance", REAL),
            ("surface", INT),
            ("place", INT),
            ("triangles", BYTE),
            *_FLAGS,
            ("wires", _PART, loops.shape[1]),
            *_END,
        ]
        yield fill(
            layout,
            len(faces),
            kind=_FACE,
            tolerance=tolerance,
            surface=surface_number[brep.face_surface[faces]],
            flags=_flags(),
            wires=shapes.parts(shapes.wire[loops], np.array(False)),
            end=_END_OF_PARTS,
        )


def container_records(brep: Brep, shapes: ShapeNumbers) -> Iterator[Records]:
    """Yield the records of shells, solids, and of their compound if there are several."""
    alone = len(shapes.roots) == 1
    order = np.argsort(brep.face_shell, kind="stable")
    bounds = np.searchsorted(brep.face_shell[order], np.arange(len(shapes.shell) + 1))
    for shell, closed in enumerate(brep.shell_closed.tolist()):
        faces = order[bounds[shell] : bounds[shell + 1]]
        parts = shapes.parts(shapes.face[faces], brep.face_reversed[faces])
        free = alone and brep.shell_solid[shell] < 0
        yield _container(_SHELL, _flags(free=free, closed=closed), parts)
    inner = _flags(free=alone)
    inner[3] = False
    for solid in range(brep.solid_count):
        shells = shapes.shell[brep.shell_solid == solid]
        yield _container(_SOLID, inner, shapes.parts(shells, np.array(False)))
    if not alone:
        outer = _flags(free=True)
        outer[3] = False
        yield _container(_COMPOUND, outer, shapes.parts(shapes.roots, np.array(False)))


def _container(kind: int, flags: Ints, parts: Records) -> Records:
    layout = [("kind", BYTE), *_FLAGS, ("parts", _PART, len(parts)), *_END]
    return fill(layout, 1, kind=kind, flags=flags, parts=parts, end=_END_OF_PARTS)
