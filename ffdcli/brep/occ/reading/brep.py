"""OpenCascade's own text files (.brep) as shapes."""

from __future__ import annotations

from pathlib import Path

from ffdcli.brep.occ.formats import is_whole_brep
from ffdcli.brep.occ.reading.loading import ReadModel, name_for_kernel, unreadable
from ffdcli.brep.occ.settings import silent_kernel
from ffdcli.files import require_file


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

    require_file(path, "give the name of a BREP file")
    name = str(path)
    if not is_whole_brep(Path(name).read_bytes()):
        raise unreadable(name, "BREP")
    shape = TopoDS_Shape()
    with silent_kernel():
        try:
            with name_for_kernel(name) as place:
                done = BRepTools.Read_s(shape, place, BRep_Builder())
        except Exception as error:
            raise unreadable(name, "BREP") from error
    if not done or shape.IsNull():
        raise unreadable(name, "BREP")
    return ReadModel(shape, None)
