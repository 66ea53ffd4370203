"""OFF text files, decoded and encoded."""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, run_starts
from ffdcli.errors import FileError
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh
from ffdcli.mesh.io.raw_mesh import RawMesh, text_resolution
from ffdcli.mesh.io.scenes import export_body
from ffdcli.mesh.io.text_numbers import parse_coordinates, parse_indices, plain_lines, truncated
from ffdcli.messages import counted

_COMMENT = re.compile(rb"#[^\n]*")
_HEADER = re.compile(rb"\s*((?:ST)?C?N?4?n?OFF)(?![A-Za-z_])[ \t]*(BINARY\b)?")


def decode_off(data: bytes, path: Path) -> RawMesh:
    """Polygons; normals, colours and texture coordinates are left out.

    Raises
    ------
    FileError
        The data is not OFF text, or is cut short.
    """
    source = str(path)
    text = _COMMENT.sub(b"", plain_lines(data))
    header = _HEADER.match(text)
    if header is None or header[2] or b"4" in header[1] or b"n" in header[1]:
        kind = "" if header is None else f", not with {b' '.join(header[0].split()).decode()}"
        raise FileError(
            f"this is not an OFF text file of three dimensions: it must begin with OFF{kind}",
            file=source,
            hint="export it as text, three coordinates per vertex",
        )
    lines = [line for line in text[header.end() :].split(b"\n") if line.strip()]
    try:
        vertex_count, polygon_count = (int(token) for token in lines[0].split()[:2])
    except (IndexError, ValueError):
        raise FileError(
            "the line after OFF must give the numbers of vertices and polygons",
            file=source,
            hint="export the mesh again",
        ) from None
    if len(lines) < 1 + vertex_count + polygon_count or min(vertex_count, polygon_count) < 0:
        raise truncated(
            source,
            f"the header promises {vertex_count} vertices and {polygon_count} polygons, "
            f"but only {len(lines) - 1} lines follow",
        )
    vertices, decimals = parse_coordinates(
        [line.split(None, 3)[:3] for line in lines[1 : 1 + vertex_count]], source
    )
    rows = [line.split() for line in lines[1 + vertex_count : 1 + vertex_count + polygon_count]]
    counts = parse_indices([row[0] for row in rows], source)
    short = np.array([len(row) for row in rows], dtype=np.int64) <= counts
    if short.any():
        raise truncated(source, f"polygon {np.argmax(short)} (counted from 0) has too few corners")
    tokens = chain.from_iterable(
        row[1 : count + 1] for row, count in zip(rows, counts.tolist(), strict=True)
    )
    corners = parse_indices(list(tokens), source)
    resolution = text_resolution(vertices, decimals)
    more = len(lines) - 1 - vertex_count - polygon_count
    notes = (f"{counted(more, 'line', 'lines')} after the last polygon left out",) if more else ()
    return RawMesh(vertices, corners, run_starts(counts), resolution, notes=notes)


def encode_off(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A text file with every digit of the coordinates."""
    digits = _decimals(mesh.vertices)
    return EncodedMesh(export_body(mesh.vertices, mesh.triangles, "off", digits=digits))


def _decimals(vertices: Floats) -> int:
    """Decimals that reproduce every bit of the largest coordinate."""
    largest = float(np.abs(vertices).max(initial=0.0))
    return 17 if largest == 0 else int(np.clip(16 - np.floor(np.log10(largest)), 0, 300))
