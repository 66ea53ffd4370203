"""Boundary representations as OpenCascade's binary stream (BinTools), written from arrays.

Building a shape object by object through the Python bindings takes ten times as long as reading it
from this stream. Parts precede the shapes that contain them, and numbers count from the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.occ.building.pcurve_uses import CoedgeUses
from ffdcli.brep.occ.building.stream_geometry import (
    Records,
    curve_records,
    pcurve_records,
    surface_records,
)
from ffdcli.brep.occ.building.stream_topology import (
    ShapeNumbers,
    container_records,
    edge_records,
    face_records,
    vertex_records,
    wire_records,
)
from ffdcli.brep.record import Brep

# Version of the format, and first bytes of a stream.
VERSION = 4
_HEAD = b"\nOpen CASCADE Topology V4, (c) Open Cascade\nLocations 0\n"


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
    coedges = CoedgeUses(brep)
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

    shapes = ShapeNumbers(brep)
    stream.write(b"Triangulations 0\n\nTShapes %d\n" % shapes.count)
    stream.write(vertex_records(brep).data)
    for records in edge_records(brep, shapes, coedges, pairs, curve_number, surface_number):
        stream.write(records.data)
    for records in wire_records(brep, shapes):
        stream.write(records.data)
    for records in face_records(brep, shapes, surface_number):
        stream.write(records.data)
    for records in container_records(brep, shapes):
        stream.write(records.data)
    stream.write(shapes.parts(np.array([shapes.count - 1]), np.array([False])).data)


def _write_numbered(
    stream: BinaryIO, batches: Iterator[tuple[Ints, Records]], number: Ints
) -> None:
    """Write records and store the place of each, from 1, in ``number``."""
    before = 0
    for owners, records in batches:
        number[owners] = before + 1 + np.arange(len(owners))
        before += len(owners)
        stream.write(records.data)
