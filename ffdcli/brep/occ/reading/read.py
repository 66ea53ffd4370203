"""CAD files of any format as OpenCascade shapes, and as plain arrays."""

from __future__ import annotations

from pathlib import Path

from ffdcli.brep.join import join_faces
from ffdcli.brep.occ.formats import CAD_FORMATS, cad_format
from ffdcli.brep.occ.reading.brep import read_brep
from ffdcli.brep.occ.reading.extract import extract
from ffdcli.brep.occ.reading.iges import read_iges
from ffdcli.brep.occ.reading.loading import ReadModel
from ffdcli.brep.occ.reading.step import read_step
from ffdcli.brep.readback import ReadBrep
from ffdcli.errors import FileError


def read_cad(path: str | Path) -> ReadModel:
    """Read a CAD file, with healing switched off and unscaled numbers.

    Raises
    ------
    FileError
        The file is missing, of no known kind, or holds nothing that OpenCascade can read.
    """
    readers = {"STEP": read_step, "IGES": read_iges, "BREP": read_brep}
    kind = cad_format(path)
    if kind is None:
        raise FileError(
            "this is no CAD file by its extension",
            file=str(path),
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    return readers[kind](path)


def record_of(model: ReadModel) -> ReadBrep:
    """The record of a file that was read; faces of trimmed surfaces are joined.

    Raises
    ------
    KernelError
        A face or edge has geometry other than planes, lines and splines.
    """
    read = extract(model.shape, model.surface_of)
    return read if model.resolution is None else join_faces(read, model.resolution)
