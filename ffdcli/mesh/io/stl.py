"""STL files: text and binary, decoded and encoded."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution, text_resolution
from ffdcli.mesh.io.scenes import export_body
from ffdcli.mesh.io.text_numbers import parse_coordinates, plain_lines, truncated
from ffdcli.messages import counted

# Facets and vertices, in the order of the file.
_STATEMENT = re.compile(
    rb"\b(?:(facet)\b|vertex\s+(\S+)\s+(\S+)\s+(\S+)|(vertex)\b)", re.IGNORECASE
)
# Names of solids may hold these words too. A line with a loop holds more than a name.
_NAME = re.compile(
    rb"^[ \t]*(?:end[ \t]*)?solid\b(?:(?!\bouter[ \t]+loop\b)[^\n])*$", re.MULTILINE | re.IGNORECASE
)
_LAST = re.compile(rb"(?:^|\s)endsolid\b[^\n]*\s*", re.IGNORECASE)
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
    room, rest = divmod(len(data) - _HEAD_SIZE, _RECORD.itemsize)
    if room == count and rest == 0:
        return _decode_binary(data, count)
    text = plain_lines(data)
    statements = _STATEMENT.findall(_NAME.sub(b"", text))
    if any(facet for facet, *_ in statements):
        return _decode_text(text, statements, str(path))
    if 0 < count <= room:
        extra = counted(len(data) - _HEAD_SIZE - _RECORD.itemsize * count, "byte", "bytes")
        note = f"{extra} after the last triangle left out: the header counts {count}"
        return replace(_decode_binary(data, count), notes=(note,))
    counts = f"it counts {count} triangles, and {len(data)} bytes hold {max(room, 0)}"
    raise FileError(
        f"this is not an STL file, or it is cut short: it has no facets as text, and as binary "
        f"{counts}",
        file=str(path),
        hint="export it again, or give it the extension of its own format",
    )


def _decode_binary(data: bytes, count: int) -> RawMesh:
    records = np.frombuffer(data, _RECORD, count, _HEAD_SIZE)
    vertices = records["corners"].reshape(-1, 3).astype(np.float64)
    return _loose_triangles(vertices, binary_resolution(vertices, np.float32))


def _decode_text(text: bytes, statements: list[tuple[bytes, ...]], source: str) -> RawMesh:
    facets = np.array([bool(facet) for facet, *_ in statements])
    # Vertices of each facet; those before the first facet belong to facet -1.
    counts = np.bincount(np.cumsum(facets)[~facets], minlength=int(facets.sum()) + 1)
    wrong = np.flatnonzero(counts != np.where(np.arange(len(counts)) > 0, 3, 0))
    if len(wrong):
        raise truncated(
            source,
            f"the {len(counts) - 1} facets have {counts.sum()} vertices instead of three each, "
            f"the first at facet {wrong[0] - 1} (counted from 0), which has {counts[wrong[0]]}",
        )
    vertices, decimals = parse_coordinates(
        [row if b"" not in row else () for facet, *row, _ in statements if not facet], source
    )
    mesh = _loose_triangles(vertices, text_resolution(vertices, decimals))
    ends = list(_LAST.finditer(text))
    if not ends:
        return replace(mesh, notes=("the last solid has no end: the file may be cut short",))
    extra = len(text) - ends[-1].end()
    what = f"{counted(extra, 'byte', 'bytes')} after the last solid left out"
    return replace(mesh, notes=(what,) if extra else ())


def _loose_triangles(vertices: Floats, resolution: float) -> RawMesh:
    count = len(vertices)
    return RawMesh(vertices, np.arange(count), np.arange(0, count + 1, 3), resolution)


def encode_stl(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A binary file."""
    return EncodedMesh(export_body(mesh.vertices, mesh.triangles, "stl"))
