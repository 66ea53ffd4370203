"""CAD file formats: extensions, STEP schemas, IGES modes and unit flags."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, get_args

from ffdcli.errors import FileError, KernelError
from ffdcli.formats import MESH_FORMATS

Schema = Literal["ap203", "ap214", "ap242"]
IgesMode = Literal["brep", "faces"]
SCHEMAS: tuple[str, ...] = get_args(Schema)
IGES_MODES: tuple[str, ...] = get_args(IgesMode)
# What makes CAD files: OpenCascade; or, for STEP, this program itself.
Writer = Literal["kernel", "direct"]
WRITERS: tuple[str, ...] = get_args(Writer)
# Whose checks a result must pass: this program's; or OpenCascade's too.
Checks = Literal["own", "kernel"]
CHECKS: tuple[str, ...] = get_args(Checks)
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
    """Reject an output file with an unknown extension, or in a folder that does not exist."""
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


def require_writer(path: str | Path, writer: Writer) -> None:
    """Reject an output file that a writer does not make."""
    if writer not in WRITERS:
        raise KernelError(f"there is no writer {writer!r}", hint=f"use one of {', '.join(WRITERS)}")
    if writer == "direct" and cad_format(path) != "STEP":
        raise FileError(
            f"only OpenCascade writes {cad_format(path)} files",
            file=str(path),
            hint="use the writer `kernel`, or write .step",
        )


def is_whole_brep(content: bytes) -> bool:
    """True if a .brep file contains all the shapes that it announces, and names its root.

    On other files OpenCascade prints errors to stdout, or never returns.
    """
    head, mark, topology = content.rpartition(b"\nTShapes ")
    lines = [line.strip() for line in topology.splitlines() if line.strip()]
    if not mark or b"CASCADE Topology V" not in head[:200] or not lines:
        return False
    # The list of parts that ends every shape ends with an asterisk.
    shapes = sum(line.endswith(b"*") for line in lines)
    return lines[0] == b"%d" % shapes and re.fullmatch(rb"[+-]\d+ \d+", lines[-1]) is not None
