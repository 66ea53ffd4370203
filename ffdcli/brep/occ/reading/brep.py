"""OpenCascade's own text files (.brep) as shapes."""

from __future__ import annotations

import re
from pathlib import Path

from ffdcli.brep.occ.reading.loading import ReadModel, require_file, unreadable
from ffdcli.brep.occ.settings import silent_kernel


def read_brep(path: str | Path) -> ReadModel:
    """Read one of OpenCascade's own text files (.brep), which state no unit.

    Raises
    ------
    FileError
        The file is missing, or is no such file.
    """
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    name = require_file(path, "BREP")
    if not _is_complete(Path(name)):
        raise unreadable(name, "BREP")
    shape = TopoDS_Shape()
    with silent_kernel():
        try:
            done = BRepTools.Read_s(shape, name, BRep_Builder())
        except Exception as error:
            raise unreadable(name, "BREP") from error
    if not done or shape.IsNull():
        raise unreadable(name, "BREP")
    return ReadModel(shape, None)


def _is_complete(path: Path) -> bool:
    """True if a .brep file contains all the shapes that it announces, and names its root.

    On other files OpenCascade prints errors to stdout, or never returns.
    """
    head, mark, topology = path.read_bytes().rpartition(b"\nTShapes ")
    lines = [line.strip() for line in topology.splitlines() if line.strip()]
    if not mark or b"CASCADE Topology V" not in head[:200] or not lines:
        return False
    # The list of parts that ends every shape ends with an asterisk.
    shapes = sum(line.endswith(b"*") for line in lines)
    return lines[0] == b"%d" % shapes and re.fullmatch(rb"[+-]\d+ \d+", lines[-1]) is not None
