"""Reads a field of displacements from a file, by its extension."""

from __future__ import annotations

from pathlib import Path

from ffdcli.errors import FileError
from ffdcli.fields.formats import FIELD_SUFFIXES, MESH_FORMATS
from ffdcli.fields.record import MAX_POINTS, Field


def read_field(
    file: str | Path,
    *,
    name: str | None = None,
    targets: str | Path | None = None,
    most: int = MAX_POINTS,
) -> Field:
    """Points and where they go, from a table, arrays of numpy, or a mesh file with a result.

    Parameters
    ----------
    file : str or Path
        A .csv table ``x,y,z,dx,dy,dz`` or ``x,y,z,tx,ty,tz``, with ``weight`` as last column if
        need be; an .npz file of `points`, `displacements` or `targets`, and perhaps `weights`; or a
        mesh file that meshio reads: .vtu, .vtk, .xdmf, .inp, .msh, .bdf.
    name : str, optional
        Name of the displacement field in a mesh file. By default the only one of vectors.
    targets : str or Path, optional
        The same mesh with its nodes moved, for mesh files without a field.
    most : int
        Largest number of points.

    Raises
    ------
    FileError
        Naming the file, what is wrong and what to do.
    """
    file = Path(file)
    suffix = file.suffix.lower()
    if suffix not in FIELD_SUFFIXES:
        shown = repr(suffix) if suffix else "no extension"
        message = f"cannot tell the format: {shown} is not that of a field known here"
        raise FileError(message, file=str(file), hint=f"use {', '.join(FIELD_SUFFIXES)}")
    # Only the reader that is needed is loaded.
    if suffix in MESH_FORMATS:
        from ffdcli.fields.mesh_files import read_mesh_field

        if name is not None and targets is not None:
            message = f"both a field, `{name}`, and targets are named"
            raise FileError(message, file=str(file), hint="name one of them")
        other = None if targets is None else Path(targets)
        return read_mesh_field(file, name=name, targets=other, most=most)
    for given, what in ((name, "a field is named"), (targets, "targets are named")):
        if given is not None:
            message = f"{what}, and a {suffix} file has its own"
            raise FileError(message, file=str(file), hint="that is for mesh files; leave it out")
    if suffix == ".csv":
        from ffdcli.fields.csv_field import read_csv

        return read_csv(file, most=most)
    from ffdcli.fields.npz import read_npz

    return read_npz(file, most=most)
