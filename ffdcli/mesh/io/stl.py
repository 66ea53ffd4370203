"""STL files: text and binary, decoded and encoded."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution, text_resolution
from ffdcli.mesh.io.scenes import export_body
from ffdcli.mesh.io.text_numbers import parse_coordinates, truncated

_FACET = re.compile(rb"\bfacet\b", re.IGNORECASE)
_VERTEX = re.compile(rb"\bvertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE)
_HEAD_SIZE = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def decode_stl(data: bytes, path: Path) -> RawMesh:
    """Triangles of all solids; each has vertices of its own.

    Raises
    ------
    FileError
        The data is not STL, or is cut short.
    """
    # A text file may begin like a binary one, and the other way round: only the size decides.
    count = int.from_bytes(data[_HEAD_SIZE - 4 : _HEAD_SIZE], "little")
    if len(data) >= _HEAD_SIZE and len(data) == _HEAD_SIZE + _RECORD.itemsize * count:
        records = np.frombuffer(data, _RECORD, count, _HEAD_SIZE)
        vertices = records["corners"].reshape(-1, 3).astype(np.float64)
        return _loose_triangles(vertices, binary_resolution(vertices, np.float32))
    found = _VERTEX.findall(data)
    facets = len(_FACET.findall(data))
    if not facets:
        raise FileError(
            "this is not an STL file: it has no facets, and its size does not match a binary"
            " header",
            file=str(path),
            hint="export it again, or give it the extension of its own format",
        )
    if len(found) != 3 * facets:
        raise truncated(
            str(path), f"the {facets} facets have {len(found)} vertices instead of three each"
        )
    vertices, decimals = parse_coordinates(found, str(path))
    return _loose_triangles(vertices, text_resolution(vertices, decimals))


def _loose_triangles(vertices: Floats, resolution: float) -> RawMesh:
    count = len(vertices)
    return RawMesh(vertices, np.arange(count), np.arange(0, count + 1, 3), resolution)


def encode_stl(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A binary file."""
    return EncodedMesh(export_body(mesh.vertices, mesh.triangles, "stl"))
