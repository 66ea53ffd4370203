"""Reads a scan from a mesh file, or from a file of points, by its extension."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import StringIO
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import FileError, MeshError
from ffdcli.fields.npz import array_names, read_arrays
from ffdcli.fields.table import bad_numbers, what_is_bad
from ffdcli.files import read_file
from ffdcli.mesh.io.ply_table import Column, ListColumn, read_table
from ffdcli.mesh.io.read import DECODERS, read_mesh
from ffdcli.mesh.polygons import triangulate
from ffdcli.scan.record import Scan

# Largest number of points of a cloud, and the least from which normals follow.
MAX_POINTS = 5_000_000
FEWEST = 20
_TABLES = (".csv", ".xyz", ".asc")
SCAN_SUFFIXES = (*DECODERS, *_TABLES, ".npz")
# Bytes of a row of a table at most.
_LONGEST = 400
_HEADER = 65536
_FACES = re.compile(rb"^element\s+(face|tristrips)\s+0*[1-9]", re.MULTILINE)
_PLACE, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_NONE = np.zeros((0, 3), dtype=np.int64)
_HINT = "give the points of the scan as x, y and z"


def is_scan(file: Path) -> bool:
    """Whether a file holds a surface or points alone, and no displacements.

    Raises
    ------
    FileError
        The file cannot be read.
    """
    suffix = file.suffix.lower()
    if suffix == ".npz":
        names = array_names(file)
        return "points" in names and not {"displacements", "targets"} & set(names)
    if suffix == ".csv":
        head = read_file(file, most=_HEADER).decode("utf-8-sig", "replace").lower().splitlines()
        first = next((line.strip() for line in head if line.strip()), "")
        cells = [cell.strip() for cell in re.split("[,;]", first)]
        return tuple(cells) in (_PLACE, _PLACE + _NORMAL)
    return suffix in DECODERS or suffix in _TABLES


def read_scan(file: str | Path) -> Scan:
    """A mesh, or a point cloud, perhaps with normals.

    Parameters
    ----------
    file : str or Path
        A mesh file, or a PLY file without faces; a table of x, y and z (.csv, .xyz, .asc), in
        which a header may name nx, ny and nz too; or an .npz file of `points` and perhaps
        `normals`.

    Raises
    ------
    FileError
        Naming the file, what is wrong and what to do.
    """
    file = Path(file)
    suffix = file.suffix.lower()
    if suffix in _TABLES:
        return _cloud(file, *_read_table(file))
    if suffix == ".npz":
        arrays = read_arrays(file, ("points", "normals"), most=MAX_POINTS, hint=_HINT)
        if "points" not in arrays:
            raise FileError("the array `points` is missing", file=str(file), hint=_HINT)
        return _cloud(file, arrays["points"], arrays.get("normals"))
    if suffix not in DECODERS:
        message = f"cannot tell the format: {suffix!r} is not that of a scan known here"
        raise FileError(message, file=str(file), hint=f"use {', '.join(SCAN_SUFFIXES)}")
    if suffix == ".ply":
        data = read_file(file)
        if not _FACES.search(data[: data.find(b"end_header")]):
            return _cloud(file, *_read_ply(data, str(file)))
    try:
        mesh = read_mesh(file)
    except MeshError as error:
        raise FileError(error.message, file=str(file), hint=error.hint) from None
    triangles, _, _ = triangulate(mesh.vertices, mesh.corners, mesh.starts)
    if not len(triangles):
        raise FileError("the mesh has no triangle with an area", file=str(file), hint=_HINT)
    return Scan(mesh.vertices, triangles)


def _read_ply(data: bytes, source: str) -> tuple[Floats, Floats | None]:
    columns = read_table(data, source, needed=("vertex",)).columns.get("vertex", {})
    found = [_columns(columns, names, source) for names in (_PLACE, _NORMAL)]
    points, normals = found
    if points is None:
        message = "it declares no element vertex with properties x, y and z"
        raise FileError(message, file=source, hint=_HINT)
    return points, normals


def _columns(columns: Mapping[str, Column], names: tuple[str, ...], source: str) -> Floats | None:
    """Numbers (n, 3) of three columns; None unless all are there."""
    given = [columns[name] for name in names if name in columns]
    plain = [column for column in given if not isinstance(column, ListColumn)]
    if len(plain) < len(names):
        return None
    try:
        return np.column_stack([column.astype(np.float64) for column in plain])
    except ValueError as error:
        raise FileError(f"a vertex has no number: {error}", file=source, hint=_HINT) from None


def _read_table(file: Path) -> tuple[Floats, Floats | None]:
    """Points and normals of a table, with commas or blanks between the numbers."""

    def fault(message: str) -> FileError:
        return FileError(message, file=str(file), hint=_HINT)

    limit = MAX_POINTS * _LONGEST
    data = read_file(file, most=limit + 1)
    if len(data) > limit:
        raise fault(f"the file is too large for {MAX_POINTS:,} points")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise fault("the file is no plain text") from None
    lines = text.replace(",", " ").replace(";", " ").splitlines()
    lines = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "//"))]
    names = lines[0].lower().split() if lines else []
    named = tuple(names[:3]) == _PLACE
    columns = [0, 1, 2]
    if named and set(names) >= set(_NORMAL):
        columns += [names.index(name) for name in _NORMAL]
    rows = lines[1:] if named else lines
    if not rows:
        raise fault("the file holds no points")
    try:
        values = np.loadtxt(StringIO("\n".join(rows)), usecols=columns, ndmin=2)
    except ValueError as error:
        raise fault(f"a row is no point: {str(error)[:100]}") from None
    return values[:, :3], values[:, 3:] if len(columns) > 3 else None


def _cloud(file: Path, points: Floats, normals: Floats | None) -> Scan:
    def fault(message: str, hint: str = _HINT) -> FileError:
        return FileError(message, file=str(file), hint=hint)

    for name, values in (("points", points), ("normals", normals)):
        if values is not None and values.shape != (len(points), 3):
            raise fault(f"`{name}` has the shape {values.shape}, not {(len(points), 3)}")
    if len(points) > MAX_POINTS:
        raise fault(f"{len(points):,} points are more than the {MAX_POINTS:,} that are allowed")
    if len(points) < FEWEST:
        what = "point" if len(points) == 1 else "points"
        raise fault(f"the file holds {len(points)} {what}, and a scan needs at least {FEWEST}")
    both = points if normals is None else np.column_stack([points, normals])
    bad = np.flatnonzero(bad_numbers(both).any(axis=1))
    if len(bad):
        message = f"point {bad[0] + 1} holds {what_is_bad(both[bad[0]])}"
        raise fault(message, "leave such points out, or mend them")
    if not np.ptp(points, axis=0).any():
        raise fault("all points are in one place")
    return Scan(points, _NONE, normals)
