"""The CAD file formats by their extensions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.errors import FileError, KernelError
from ffdcli.files import whole_file
from ffdcli.formats import MESH_FORMATS

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from ffdcli.brep.labels import ShapeLabels

Schema = Literal["ap203", "ap214", "ap242"]
IgesMode = Literal["brep", "faces"]
SCHEMAS: tuple[str, ...] = get_args(Schema)
IGES_MODES: tuple[str, ...] = get_args(IgesMode)
# STEP schemas without colours, layers and properties: OpenCascade writes AP203's first edition.
UNPAINTED = ("ap203",)

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


def require_writable(path: str | Path) -> None:
    """Refuse an output whose extension is not known, or whose folder is not there.

    Raises
    ------
    FileError
    """
    path = Path(path)
    if cad_format(path) is None:
        raise FileError(
            f"cannot write a file of kind {path.suffix or 'without an extension'!r}",
            file=str(path),
            hint=f"use one of {', '.join(CAD_FORMATS)}; "
            f"ffd deform and tessellate() write meshes too: {', '.join(MESH_FORMATS)}",
        )
    if path.is_dir() or not path.parent.is_dir():
        what = "is a folder" if path.is_dir() else "is in a folder that does not exist"
        raise FileError(f"the output {what}", file=str(path), hint="name a file in a folder")


def write_cad(shape: TopoDS_Shape, path: str | Path, **how: Any) -> int:
    """Write a CAD file by its extension, whole or not at all.

    Parameters
    ----------
    shape, path, how
        As for :func:`begin_cad`.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError, FileError
    """
    with begin_cad(shape, path, **how) as size:
        return size


@contextmanager
def begin_cad(
    shape: TopoDS_Shape,
    path: str | Path,
    *,
    unit: str = "mm",
    schema: Schema = "ap214",
    pcurves: bool = True,
    iges_mode: IgesMode = "brep",
    labels: ShapeLabels | None = None,
    header: FileHeader | None = None,
    digits: int = 17,
    processes: int = 1,
) -> Iterator[int]:
    """Write a CAD file by its extension, which takes its place when the block ends well.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its numbers are written as they are.
    path : str or Path
    unit : str
        The unit the numbers are in, for the header; BREP files have no place for it.
    schema : {"ap203", "ap214", "ap242"}
        For STEP.
    pcurves : bool
        For STEP: give edges their curves in the parameters of their faces too.
    iges_mode : {"brep", "faces"}
        For IGES: solids, or trimmed surfaces.
    labels : ShapeLabels, optional
        Names and colours, as far as the format has a place for them; BREP files have none.
    header : FileHeader, optional
    digits : int
        Significant digits in STEP files; 17 are full double precision, which other formats always
        have.
    processes : int
        How many may work on a STEP file at once.

    Yields
    ------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError
        An unknown extension, unit, schema or mode, or OpenCascade failed.
    FileError
        The file cannot be written.
    """
    from ffdcli.brep.occ.writing.brep import brep_bytes
    from ffdcli.brep.occ.writing.iges import iges_bytes
    from ffdcli.brep.occ.writing.step import step_bytes

    kind, name = cad_format(path), Path(path).name
    if kind is None:
        raise KernelError(
            f"there is no CAD format for the extension {Path(path).suffix!r}",
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    content: bytes | memoryview
    with whole_file(path) as stream:
        if kind == "STEP":
            content = step_bytes(
                shape,
                name,
                unit=unit,
                schema=schema,
                pcurves=pcurves,
                labels=labels,
                header=header,
                digits=digits,
                processes=processes,
            )
        elif kind == "IGES":
            content = iges_bytes(
                shape, name, unit=unit, mode=iges_mode, labels=labels, header=header
            )
        else:
            content = brep_bytes(shape)
        yield stream.write(content)
