"""The CAD file formats by their extensions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from ffdcli.brep.occ.header import FileHeader
from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

Schema = Literal["ap203", "ap214", "ap242"]
IgesMode = Literal["brep", "faces"]
SCHEMAS: tuple[str, ...] = get_args(Schema)
IGES_MODES: tuple[str, ...] = get_args(IgesMode)

# Formats by extension.
CAD_FORMATS = {
    ".step": "STEP",
    ".stp": "STEP",
    ".iges": "IGES",
    ".igs": "IGES",
    ".brep": "BREP",
}


def cad_format(path: str | Path) -> str | None:
    """Return ``STEP``, ``IGES``, ``BREP``, or None for other extensions."""
    return CAD_FORMATS.get(Path(path).suffix.lower())


def write_cad(
    shape: TopoDS_Shape,
    path: str | Path,
    *,
    unit: str = "mm",
    schema: Schema = "ap214",
    iges_mode: IgesMode = "brep",
    name: str = "part",
    header: FileHeader | None = None,
    digits: int = 17,
) -> int:
    """Write a CAD file by its extension, whole or not at all.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    path : str or Path
    unit : str
        The unit the numbers are in, for the header; BREP files have no place for it.
    schema : {"ap203", "ap214", "ap242"}
        For STEP.
    iges_mode : {"brep", "faces"}
        For IGES: solids, or trimmed surfaces.
    name : str
        Name of the product.
    header : FileHeader, optional
    digits : int
        Significant digits in STEP files; 17 are full double precision, which other formats always
        have.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError
        An unknown extension, unit, schema or mode, or OpenCascade failed.
    FileError
        The file cannot be written.
    """
    from ffdcli.brep.occ.write import write_step
    from ffdcli.brep.occ.write_brep import write_brep
    from ffdcli.brep.occ.write_iges import write_iges

    kind = cad_format(path)
    if kind == "STEP":
        return write_step(
            shape, path, unit=unit, schema=schema, name=name, header=header, digits=digits
        )
    if kind == "IGES":
        return write_iges(shape, path, unit=unit, mode=iges_mode, name=name, header=header)
    if kind == "BREP":
        return write_brep(shape, path)
    raise KernelError(
        f"there is no CAD format for the extension {Path(path).suffix!r}",
        hint=f"use one of {', '.join(CAD_FORMATS)}",
    )
