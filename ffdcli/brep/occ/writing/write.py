"""Write a shape to a CAD file, in the format of the file's extension."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.occ.formats import (
    CAD_FORMATS,
    IgesMode,
    Schema,
    cad_format,
)
from ffdcli.brep.occ.writing.brep import brep_bytes
from ffdcli.brep.occ.writing.far_from_origin import require_parts
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.iges import iges_bytes
from ffdcli.brep.occ.writing.reopen import require_readable
from ffdcli.brep.occ.writing.step import step_bytes
from ffdcli.errors import KernelError
from ffdcli.files import whole_file

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from ffdcli.brep.labels import ShapeLabels


def write_cad(shape: TopoDS_Shape, path: str | Path, **how: Any) -> int:
    """Write a CAD file in the format of its extension; a failure leaves no partial file.

    Parameters
    ----------
    shape, path, how
        As for :func:`begin_cad`.

    Returns
    -------
    int
        Size of the file in bytes.
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
    """Write a CAD file in the format of its extension; rename it into place after the block.

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
    kind, name = cad_format(path), Path(path).name
    if kind is None:
        raise KernelError(
            f"there is no CAD format for the extension {Path(path).suffix!r}",
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    content: bytes | memoryview
    with whole_file(path) as stream:
        if kind == "STEP":
            content = step = step_bytes(
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
            require_parts(shape, step)
        elif kind == "IGES":
            content = iges_bytes(
                shape, name, unit=unit, mode=iges_mode, labels=labels, header=header
            )
        else:
            content = brep_bytes(shape)
        require_readable(kind, content)
        yield stream.write(content)
