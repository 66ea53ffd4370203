"""PLY files: text and binary, decoded and encoded.

The decoder is our own: others reject binary files whose polygons differ in their number of corners,
or round double precision to single.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh, split_at_seams
from ffdcli.mesh.io.ply_table import (
    CORNERS,
    FACES,
    STRIPS,
    ListColumn,
    PlyTable,
    bad_header,
    read_table,
)
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution, text_resolution
from ffdcli.mesh.io.scenes import export_body
from ffdcli.mesh.io.text_numbers import parse_coordinates, parse_indices
from ffdcli.messages import counted

# Names of texture coordinates: a list of each face, or two columns of the vertices.
_FACE_UV = "texcoord"
_VERTEX_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))


def decode_ply(data: bytes, path: Path) -> RawMesh:
    """Vertices, faces, strips of triangles and texture coordinates; all else is left out.

    Raises
    ------
    FileError
        The header is not that of PLY, the file ends too early, or a number cannot be read.
    """
    source = str(path)
    table = read_table(data, source, needed=("vertex", FACES, STRIPS))
    points = [table.columns.get("vertex", {}).get(axis) for axis in "xyz"]
    plain = [column for column in points if isinstance(column, np.ndarray)]
    if len(plain) < 3:
        raise bad_header(source, "it declares no element vertex with properties x, y and z")
    kinds = {p.kind for p in table.properties["vertex"] if p.name in ("x", "y", "z")}
    stored = np.float64 if kinds == {"f8"} else np.float32
    faces, strips = _lists(table, FACES), _lists(table, STRIPS)
    if table.is_text:
        rows = list(zip(*(column.tolist() for column in plain), strict=True))
        vertices, decimals = parse_coordinates(rows, source)
        corners = parse_indices(faces.values.tolist(), source)
        places = parse_indices(strips.values.tolist(), source)
        resolution = max(binary_resolution(vertices, stored), text_resolution(vertices, decimals))
    else:
        vertices = np.column_stack(plain).astype(np.float64)
        corners, places = faces.values.astype(np.int64), strips.values.astype(np.int64)
        resolution = binary_resolution(vertices, stored)
    triangles, joining = _strip_triangles(places, strips.starts)
    corners = np.concatenate([corners, triangles.ravel()])
    more = np.arange(1, len(triangles) + 1) * 3
    starts = np.concatenate([faces.starts, faces.starts[-1] + more])
    notes: tuple[str, ...] = ()
    if joining:
        what = counted(joining, "triangle", "triangles")
        notes = (f"{what} with a vertex twice, which only join strips, left out",)
    uv = _texture(table, corners, starts)
    return RawMesh(vertices, corners, starts, resolution, notes=notes, uv=uv)


def _strip_triangles(places: Ints, starts: Ints) -> tuple[Ints, int]:
    """Triangles (T, 3) of strips, and the number of those left out, which have a vertex twice.

    Each strip is a run of vertices. It ends at a negative one, and another begins. Every other
    triangle is turned round.
    """
    fresh = places < 0
    fresh[starts[:-1][np.diff(starts) > 0]] = True
    # Number of the entry within its strip; the entry that ends a strip is none of the next.
    first = np.maximum.accumulate(np.where(fresh, np.arange(len(places)), 0))
    within = np.arange(len(places)) - first - (places[first] < 0)
    third = np.flatnonzero(within > 1)
    triangles = np.column_stack([places[third - 2], places[third - 1], places[third]])
    odd = within[third] % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return triangles[whole], int(np.count_nonzero(~whole))


def _lists(table: PlyTable, element: str) -> ListColumn:
    """Lists of corners: the one with a known name, else the first list of integers."""
    lists = [
        p.name
        for p in table.properties.get(element, ())
        if p.count_kind and not p.kind.startswith("f")
    ]
    lists.sort(key=lambda name: name not in CORNERS)
    found = table.columns[element][lists[0]] if lists else None
    if isinstance(found, ListColumn):
        return found
    return ListColumn(np.empty(0, dtype=np.int64), np.zeros(1, dtype=np.int64))


def _texture(table: PlyTable, corners: Ints, starts: Ints) -> Floats | None:
    """(C, 2) texture coordinates of the faces, else of their vertices; None if neither has any."""
    lists = table.columns.get("face", {}).get(_FACE_UV)
    vertex = table.columns["vertex"]
    pair = next((names for names in _VERTEX_UV if all(name in vertex for name in names)), ())
    try:
        if isinstance(lists, ListColumn):
            uv = np.full((len(corners), 2), np.nan)
            # The list of a face without texture coordinates is empty.
            lengths = np.diff(lists.starts)
            counts = np.diff(starts)[: len(lengths)]
            given = lengths == 2 * counts
            values = lists.values[np.repeat(given, lengths)]
            chosen = np.flatnonzero(np.repeat(given, counts))
            uv[chosen] = values.astype(np.float64).reshape(-1, 2)
            return uv
        found = [vertex[name] for name in pair]
        plain = [column for column in found if isinstance(column, np.ndarray)]
        if len(plain) < 2:
            return None
        rows = np.column_stack(plain).astype(np.float64)
    except ValueError:  # a token is not a number
        return np.full((len(corners), 2), np.nan)
    # Corners without a vertex are rejected later.
    missing = (corners < 0) | (corners >= len(rows))
    rows = np.concatenate([rows, [[np.nan, np.nan]]])
    return np.asarray(rows[np.where(missing, -1, corners)])


def encode_ply(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A binary file with colours of faces and texture coordinates of vertices."""
    vertices, triangles, attributes = mesh.vertices, mesh.triangles, None
    if mesh.uv is not None:
        used, triangles, places = split_at_seams(triangles, mesh.uv)
        vertices, attributes = vertices[used], {"s": places[:, 0], "t": places[:, 1]}
    colours = mesh.paint.face_colours() if mesh.paint.coloured else None
    return EncodedMesh(
        export_body(vertices, triangles, "ply", vertex_attributes=attributes, face_colours=colours)
    )
