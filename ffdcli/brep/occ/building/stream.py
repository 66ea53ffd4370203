"""The integer record as OpenCascade's own binary stream (BinTools), written from arrays.

Object by object, through Python bindings, a shape takes ten times as long as OpenCascade takes to
read it from this stream. Shapes are numbered from the last: a part stands before what it is part
of, and its number counts from the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.occ.building.stream_geometry import (
    BYTE,
    INT,
    REAL,
    Records,
    curve_records,
    fill,
    lengths,
    pcurve_records,
    surface_records,
)
from ffdcli.brep.record import Brep
from ffdcli.errors import KernelError

# The version of the format, and how a stream of it begins.
VERSION = 4
_HEAD = b"\nOpen CASCADE Topology V4, (c) Open Cascade\nLocations 0\n"
# Kinds of shapes.
_COMPOUND, _SOLID, _SHELL, _FACE, _WIRE, _EDGE, _VERTEX = 0, 2, 3, 4, 5, 6, 7
# Free, modified, checked, orientable, closed, infinite, convex.
_FLAGS = [("flags", BYTE, 7)]
_PART = np.dtype([("reversed", BYTE), ("number", INT), ("place", INT)])
_END = [("end", BYTE)]
_END_OF_PARTS = ord("*")
# What stands for an edge: its curve, a pcurve, or two of them where a surface meets itself.
_CURVE, _PCURVE, _SEAM = 1, 2, 3


def write_stream(brep: Brep, stream: BinaryIO) -> None:
    """Write a boundary representation as a binary stream that ``BinTools`` reads.

    One vertex and one edge each, shared. A straight edge between planes becomes a line with its
    length as parameter; every other edge keeps its B-spline curve on [0, 1], with straight pcurves
    of the same parameter. Solids, their shells and the shells' faces keep the record's order.

    Parameters
    ----------
    brep : Brep
        All lengths are taken as they are.
    stream : binary file

    Raises
    ------
    KernelError
        Something that OpenCascade would refuse; the message says what.
    """
    coedges = _Coedges(brep)
    stream.write(_HEAD)
    pairs = coedges.pairs()
    stream.write(b"Curve2ds %d\n" % len(pairs.ends))
    stream.write(pcurve_records(pairs.ends).data)
    curve_number = np.zeros(len(brep.edges), dtype=np.int64)
    stream.write(b"Curves %d\n" % len(brep.edges))
    _write_numbered(stream, curve_records(brep, coedges.straight), curve_number)
    surface_number = np.zeros(brep.surface_count, dtype=np.int64)
    stream.write(b"Polygon3D 0\nPolygonOnTriangulations 0\n")
    stream.write(b"Surfaces %d\n" % len(surface_number))
    _write_numbered(stream, surface_records(brep), surface_number)

    shapes = _Shapes(brep)
    stream.write(b"Triangulations 0\n\nTShapes %d\n" % shapes.count)
    stream.write(_vertices(brep).data)
    for records in _edges(brep, shapes, coedges, pairs, curve_number, surface_number):
        stream.write(records.data)
    for records in _wires(brep, shapes):
        stream.write(records.data)
    for records in _faces(brep, shapes, surface_number):
        stream.write(records.data)
    for records in _containers(brep, shapes):
        stream.write(records.data)
    stream.write(shapes.parts(np.array([shapes.count - 1]), np.array([False])).data)


def _write_numbered(
    stream: BinaryIO, batches: Iterator[tuple[Ints, Records]], number: Ints
) -> None:
    """Write records and note, from 1, the place of each in ``number``."""
    before = 0
    for owners, records in batches:
        number[owners] = before + 1 + np.arange(len(owners))
        before += len(owners)
        stream.write(records.data)


class _Pairs:
    """Edges on B-spline surfaces they border, sorted by edge and surface.

    ``edge``, ``surface`` (n,), the number of the pcurve from 1 (n,), whether a second one for
    the other sense follows it (n,), and the ends of all pcurves (m, 2, 2).
    """

    def __init__(self, edge: Ints, surface: Ints, pcurve: Ints, seam: Bools, ends: Floats) -> None:
        self.edge, self.surface, self.pcurve = edge, surface, pcurve
        self.seam, self.ends = seam, ends


class _Coedges:
    """What the coedges say about edges and surfaces."""

    def __init__(self, brep: Brep) -> None:
        face = brep.face_of_coedge
        plane = np.zeros(brep.surface_count, dtype=bool)
        plane[brep.planes.surfaces] = True
        self.brep, self.face = brep, face
        self.on_plane = plane[brep.face_surface[face]]
        between_planes = np.ones(len(brep.edges), dtype=bool)
        between_planes[brep.coedge_edge[~self.on_plane]] = False
        # (E,) edges that become lines.
        self.straight = np.zeros(len(brep.edges), dtype=bool)
        for batch in brep.curves:
            if batch.degree == 1 and batch.poles.shape[1:] == (2, 3):
                self.straight[batch.edges] = between_planes[batch.edges]

    def pairs(self) -> _Pairs:
        """Edges and the B-spline surfaces they border, each with its straight pcurve.

        An edge that borders one surface twice (a slit, or two faces that trim the same surface)
        has one pcurve if both uses agree; else one for each sense, as the kernel keeps a seam.
        """
        brep = self.brep
        used = np.flatnonzero(~self.on_plane)
        surface = brep.face_surface[self.face]
        in_face = brep.coedge_forward ^ brep.face_reversed[self.face]
        # The forward use of a seam comes first.
        order = used[np.lexsort((~in_face[used], surface[used], brep.coedge_edge[used]))]
        edge, surface, ends = brep.coedge_edge[order], surface[order], brep.pcurves[order]
        first = np.ones(len(order), dtype=bool)
        first[1:] = (np.diff(edge) != 0) | (np.diff(surface) != 0)
        starts = np.flatnonzero(first)
        owner = np.cumsum(first) - 1
        uses = np.bincount(owner, minlength=len(starts))
        differs = np.zeros(len(starts), dtype=bool)
        differs[owner[(ends != ends[starts][owner]).any(axis=(1, 2))]] = True
        # The second use, or the only one.
        second = starts + (uses > 1)
        opposite = in_face[order[starts]] != in_face[order[second]]
        wrong = np.flatnonzero(differs & ~((uses == 2) & opposite))
        if len(wrong):
            at = wrong[0]
            raise KernelError(
                f"edge {edge[starts[at]]} lies on surface {surface[starts[at]]} {uses[at]} times "
                "with different parameters; a CAD edge can do so twice, once in each sense"
            )
        kept = np.zeros(len(order), dtype=bool)
        kept[starts] = True
        kept[second[differs]] = True
        number = np.cumsum(kept)[starts]
        return _Pairs(edge[starts], surface[starts], number, differs, ends[kept])


class _Shapes:
    """Where every shape stands in the list: vertices, edges, wires, faces, shells, solids.

    A shell of no solid, and the solids, are parts of a compound where there are several.
    """

    def __init__(self, brep: Brep) -> None:
        self.vertex = np.arange(len(brep.points))
        # Edges, wires and faces stand in the order in which their records are written.
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
        """Name shapes as parts of others."""
        parts = np.zeros(shapes.shape, dtype=_PART)
        parts["reversed"], parts["number"] = reverse, self.count - shapes
        return parts


def _flags(*, free: bool = False, closed: bool | Bools = False, convex: bool = False) -> Ints:
    """Flags of a shape of faces, or of a part of one: modified, and orientable."""
    closed = np.asarray(closed)
    flags = np.zeros((*closed.shape, 7), dtype=np.int64)
    flags[..., 0], flags[..., 1], flags[..., 3] = free, True, True
    flags[..., 4], flags[..., 6] = closed, convex
    return flags


def _vertices(brep: Brep) -> Records:
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


def _edges(
    brep: Brep,
    shapes: _Shapes,
    coedges: _Coedges,
    pairs: _Pairs,
    curve_number: Ints,
    surface_number: Ints,
) -> Iterator[Records]:
    """Yield edges with as many pcurves of the same kinds together, and number them."""
    ends = np.ones(len(brep.edges))
    if coedges.straight.any():
        for batch in brep.curves:
            lines = coedges.straight[batch.edges]
            # None of the rational curves is a line.
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
    """One pcurve of an edge; a seam has a second one, and a continuity (0: C0)."""
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
    """Yield the owners that have equally many items, and their items' numbers (n, count)."""
    counts = np.diff(starts)
    for count in np.unique(counts).tolist():
        owners = np.flatnonzero(counts == count)
        yield owners, starts[owners, None] + np.arange(count)


def _wires(brep: Brep, shapes: _Shapes) -> Iterator[Records]:
    """Yield wires with as many edges together, and number them."""
    loop_turned = brep.face_reversed[brep.face_of_loop]
    before = shapes.first_wire
    for loops, coedges in _runs(brep.loop_coedges):
        shapes.wire[loops] = before + np.arange(len(loops))
        before += len(loops)
        # The kernel's wires run round the surface's normal, ours round the outward one.
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


def _faces(brep: Brep, shapes: _Shapes, surface_number: Ints) -> Iterator[Records]:
    """Yield faces with as many wires together, and number them."""
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


def _containers(brep: Brep, shapes: _Shapes) -> Iterator[Records]:
    """Yield shells, solids, and the compound of all where there are several."""
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
