"""Nodes, elements and named fields of a mesh file, read by meshio."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.fields.text_meshes import check_abaqus, check_ansys, check_nastran
from ffdcli.fields.xml_meshes import check_vtu, read_xdmf

# What a file of each format says of its nodes that meshio does not; refuses what meshio misreads.
_CHECKS: dict[str, Callable[[Path], Ints]] = {
    "vtu": check_vtu,
    "abaqus": check_abaqus,
    "ansys": check_ansys,
    "nastran": check_nastran,
}


@dataclass(frozen=True, eq=False)
class Contents:
    """What a field takes from a mesh file.

    Parameters
    ----------
    points : (n, 3) float64
    ids : (n,) int64
        Numbers of the nodes in the file; empty if it has none.
    values : (n, 3) float64 or None
        The field, or None if there is no field of vectors and none was named.
    name : str or None
        Name of the field.
    cells : str
        Digest of the elements.
    notes : tuple of str
    """

    points: Floats
    ids: Ints
    values: Floats | None
    name: str | None
    cells: str
    notes: tuple[str, ...]


def read_contents(file: Path, format_name: str, name: str | None, most: int) -> Contents:
    """Read a file with meshio.

    Parameters
    ----------
    file : Path
    format_name : {"vtu", "vtk", "xdmf", "abaqus", "ansys", "nastran"}
        As meshio names them.
    name : str or None
        The field of displacements; None: the only field of vectors at nodes; "": none.
    most : int
        Largest number of nodes.

    Raises
    ------
    FileError
        meshio does not read all that the file holds, or the field is not there.
    """
    notes: tuple[str, ...] = ()
    stated: Ints | None = None
    if format_name == "xdmf":
        points, data, cell_data, cells, notes = read_xdmf(file)
    else:
        import meshio

        if format_name in _CHECKS:
            stated = _CHECKS[format_name](file)
        mesh = meshio.read(file, file_format=format_name)
        points, data, cell_data = np.asarray(mesh.points), mesh.point_data, mesh.cell_data
        cells = mesh.cells
    if points.ndim != 2 or points.shape[1] != 3:
        message = f"its nodes have the shape {points.shape}; needed are three coordinates for each"
        raise _fault(file, message, "write it as a mesh in space")
    if stated is not None and len(stated) and len(stated) != len(points):
        message = f"it has {len(stated):,} nodes, of which meshio reads {len(points):,}"
        raise _fault(file, message, None)
    if len(points) > most:
        message = f"{len(points):,} nodes are more than the {most:,} that are allowed"
        raise _fault(file, message, "give fewer nodes, as a table")
    if format_name == "vtk":
        # Legacy files of VTK write blanks in names as %20.
        data = {unquote(key): value for key, value in data.items()}
    chosen = _choose(file, data, cell_data, name, len(points))
    if name is None and chosen is not None:
        notes += (f"the field `{chosen}` of `{file.name}` is taken",)
    values = None if chosen is None else np.array(data[chosen], dtype=np.float64)
    ids = np.zeros(0, dtype=np.int64) if stated is None else stated
    return Contents(np.array(points, dtype=np.float64), ids, values, chosen, _digest(cells), notes)


def _choose(
    file: Path, data: dict[str, Any], cell_data: dict[str, Any], name: str | None, count: int
) -> str | None:
    """Name of the field to take; None if there is none and none is asked for."""
    vectors = [
        key
        for key, value in data.items()
        if np.shape(value) == (count, 3) and np.asarray(value).dtype.kind in "fiu"
    ]
    named = ", ".join(f"`{key}`" for key in vectors[:20]) or "none"
    if name == "":
        return None
    if name is not None:
        if name in vectors:
            return name
        what = "there is no field of this name"
        if name in data:
            what = f"it has the shape {np.shape(data[name])}, not three numbers for each node"
        elif name in cell_data:
            what = "it is given for elements, not for nodes"
        hint = f"fields of three numbers for each node: {named}"
        raise _fault(file, f"the field `{name[:60]}`: {what}", hint)
    if len(vectors) > 1:
        message = f"it holds several fields of three numbers for each node: {named}"
        raise _fault(file, message, "say which: `field: NAME`, or `--field NAME`")
    return vectors[0] if vectors else None


def _digest(cells: Any) -> str:
    """Digest of element types and their nodes; empty without elements."""
    total = hashlib.sha256()
    for block in cells:
        total.update(f"{block.type} {len(block.data)}\n".encode())
        for row in block.data if isinstance(block.data, list) else [block.data]:
            total.update(np.ascontiguousarray(row, dtype=np.int64).tobytes())
    return total.hexdigest() if len(cells) else ""


def _fault(file: Path, message: str, hint: str | None) -> FileError:
    return FileError(message, file=str(file), hint=hint)
