"""Write triangles to a mesh file by its extension, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ffdcli.errors import FileError
from ffdcli.files import write_whole
from ffdcli.formats import MESH_FORMATS, MeshFormat, mesh_format
from ffdcli.mesh.io.gltf.write import encode_glb
from ffdcli.mesh.io.obj import encode_obj
from ffdcli.mesh.io.off import encode_off
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh
from ffdcli.mesh.io.ply import encode_ply
from ffdcli.mesh.io.read import decoder
from ffdcli.mesh.io.stl import encode_stl
from ffdcli.mesh.io.threemf.write import encode_3mf

ENCODERS: dict[str, Callable[[PaintedMesh, Path], EncodedMesh]] = {
    ".stl": encode_stl,
    ".obj": encode_obj,
    ".ply": encode_ply,
    ".off": encode_off,
    ".glb": encode_glb,
    ".3mf": encode_3mf,
}


@dataclass(frozen=True)
class Written:
    """What the file holds of the triangles.

    Parameters
    ----------
    bytes : int
    rounding : float, model length
        Largest distance by which the precision of the format moves a vertex.
    collapsed : int
        Triangles with two corners in one place after rounding.
    unnamed : tuple of str
        Groups whose names the file does not hold.
    """

    bytes: int
    rounding: float
    collapsed: int
    unnamed: tuple[str, ...] = ()


def require_mesh_format(path: str | Path, unit: str | None = None) -> MeshFormat:
    """The format of a mesh file to be written.

    Raises
    ------
    FileError
        The extension is not that of a mesh format, or the format states units, but not this one.
    """
    kind = mesh_format(path)
    if kind is None:
        raise FileError(
            f"cannot write a mesh of kind {Path(path).suffix or 'without an extension'!r}",
            file=str(path),
            hint=f"use one of {', '.join(MESH_FORMATS)}",
        )
    if kind.units is not None and unit is not None and unit not in kind.units:
        raise FileError(
            f"{kind.name} files cannot be in the unit {unit!r}",
            file=str(path),
            hint=f"use {', '.join(kind.units)}, or another format",
        )
    return kind


def write_mesh(path: str | Path, mesh: PaintedMesh) -> Written:
    """Write a mesh in the format of its extension, whole or not at all.

    OBJ and GLB hold the names of groups, 3MF those of whole bodies. OBJ (with a material file
    beside it), GLB and 3MF hold materials, PLY only their colours. OBJ, PLY and GLB hold texture
    coordinates; PLY and GLB one pair per vertex, so vertices at seams are doubled. Only 3MF states
    the unit. Every file is read again, and its triangles counted, before it takes its place.

    Raises
    ------
    FileError
        The extension or the unit is unknown, or the file cannot be written, or not be read again.
    """
    path = Path(path)
    kind = require_mesh_format(path, mesh.unit)
    encoded = ENCODERS[path.suffix.lower()](mesh, path)
    found = len(decoder(path.suffix.lower())(encoded.content, path).starts) - 1
    if found != len(mesh.triangles):
        raise FileError(
            f"the {kind.name} file would be read with {found} of {len(mesh.triangles)} triangles",
            file=str(path),
            hint="nothing was written; please report it with the files",
        )
    stored = mesh.vertices
    if kind.single_precision:
        stored = stored.astype(np.float32).astype(np.float64)
    corner = stored[mesh.triangles]
    same = (corner == np.roll(corner, -1, axis=1)).all(axis=2)
    for other, content in encoded.beside.items():
        write_whole(other, content)
    write_whole(path, encoded.content)
    return Written(
        bytes=len(encoded.content),
        rounding=float(np.linalg.norm(stored - mesh.vertices, axis=1).max(initial=0.0)),
        collapsed=int(np.count_nonzero(same.any(axis=1))),
        unnamed=encoded.unnamed,
    )
