"""Loading of STEP and IGES files with OpenCascade's repairs switched off."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.errors import FileError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# Repairs of OpenCascade's readers. With all of them off, flipped faces, inverted solids, missing
# and doubled faces are read as they were written.
HEALING = (
    "FixFreeShellMode",
    "FixFreeFaceMode",
    "FixFreeWireMode",
    "FixSameParameterMode",
    "FixSolidMode",
    "FixShellMode",
    "FixFaceMode",
    "FixWireMode",
    "FixShellOrientationMode",
    "FixFaceOrientationMode",
    "FixVertexPositionMode",
    "FixVertexToleranceMode",
)

# Trimmed surfaces have no vertices. The only repairs left on order the curves of a loop and merge
# the ends of consecutive curves into vertices.
_CONNECTING = ("FixFreeFaceMode", "FixFaceMode", "FixWireMode")
HEALING_BUT_CONNECTING = (
    *(mode for mode in HEALING if mode not in _CONNECTING),
    "FixOrientationMode",
    "FixAddNaturalBoundMode",
    "FixMissingSeamMode",
    "FixSmallAreaWireMode",
    "FixIntersectingWiresMode",
    "FixLoopWiresMode",
    "FixSplitFaceMode",
    "FixSmallMode",
    "FixEdgeCurvesMode",
    "FixDegeneratedMode",
    "FixLackingMode",
    "FixSelfIntersectionMode",
    "FixNotchedEdgesMode",
    "FixTailMode",
)

# STEP files have no edges at poles and apexes, and a surface that is closed but not periodic has
# no second side for a seam; IGES readers drop curves on planar splines. The only repairs left on
# add these, and turn loops whose seams got the wrong sides.
_COMPLETING = (
    *("FixSolidMode", "FixFreeShellMode", "FixShellMode", "FixFreeFaceMode"),
    *("FixFaceMode", "FixWireMode"),
)
_ADDING = ("FixEdgeCurvesMode", "FixDegeneratedMode", "FixLackingMode", "FixOrientationMode")
HEALING_BUT_COMPLETING = (
    *(mode for mode in HEALING if mode not in _COMPLETING),
    *(mode for mode in HEALING_BUT_CONNECTING if mode not in (*HEALING, *_ADDING)),
    "FixReorderMode",
    "FixConnectedMode",
    "FixGap2dMode",
    "FixGap3dMode",
    "FixSelfIntersectingEdgeMode",
    "FixIntersectingEdgesMode",
    "FixNonAdjacentIntersectingEdgesMode",
    "FixPeriodicDegeneratedMode",
)


@dataclass(frozen=True)
class ReadModel:
    """A CAD file as read by OpenCascade.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its coordinates are the numbers in the file.
    unit : str or None
        Unit of those numbers by the file's header; None if the format has none.
    resolution : float or None, model length
        Distance within which edges coincide, for files of trimmed surfaces, whose faces share no
        edges; None if the file states shared edges.
    surface_of : dict
        The file's surface of each face (by its ``TShape``) where several faces trim one that
        OpenCascade's reader has made anew for each.
    """

    shape: TopoDS_Shape
    unit: str | None
    resolution: float | None = None
    surface_of: dict[Any, Any] = field(default_factory=dict)


@contextmanager
def name_for_kernel(name: str) -> Iterator[str]:
    """A name by which OpenCascade opens a file: it takes names in UTF-8 only."""
    try:
        name.encode()
    except UnicodeEncodeError:
        with tempfile.TemporaryDirectory(prefix="ffd-") as folder:
            link = Path(folder, "link")
            link.symlink_to(os.path.abspath(name))
            yield str(link)
    else:
        yield name


def load(reader: Any, name: str, kind: str) -> int:
    """Load a file into a reader: the number of its root entities.

    Raises
    ------
    FileError
        OpenCascade cannot read the file, or the file contains no shapes.
    """
    from OCP.IFSelect import IFSelect_ReturnStatus

    try:
        with name_for_kernel(name) as place:
            status = reader.ReadFile(place)
    except Exception as error:
        raise unreadable(name, kind) from error
    if status != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise unreadable(name, kind)
    roots: int = reader.NbRootsForTransfer()
    if roots == 0:
        raise FileError("the file holds no shapes", file=name)
    return roots


def transfer(reader: Any, roots: int, name: str) -> Any:
    """The shape of a loaded file."""
    transferred = reader.TransferRoots()
    if transferred != roots or reader.NbShapes() == 0:
        raise FileError(
            f"OpenCascade could make only {transferred} of the {roots} parts in the file",
            file=name,
        )
    return reader.OneShape()


def unreadable(name: str, kind: str) -> FileError:
    """The error for a file that OpenCascade cannot read."""
    article = "an" if kind == "IGES" else "a"
    return FileError(
        f"this is not {article} {kind} file that OpenCascade can read, or it is cut short",
        file=name,
    )


def limit_tolerance(shape: TopoDS_Shape, least: float) -> None:
    """Raise the tolerances of a shape to at least ``least``, model length."""
    from OCP.ShapeFix import ShapeFix_ShapeTolerance

    ShapeFix_ShapeTolerance().LimitTolerance(shape, least)


@contextmanager
def switched_off(reader: Any, repairs: tuple[str, ...]) -> Iterator[None]:
    """Switch repairs of a reader off within the block.

    OpenCascade's IGES readers share these parameters, so they are restored afterwards.
    """
    from OCP.Resource import Resource_DataMapOfAsciiStringAsciiString
    from OCP.TCollection import TCollection_AsciiString

    off = Resource_DataMapOfAsciiStringAsciiString()
    for mode in repairs:
        off.Bind(TCollection_AsciiString(f"FixShape.{mode}"), TCollection_AsciiString("0"))
    before = Resource_DataMapOfAsciiStringAsciiString(reader.GetShapeFixParameters())
    reader.SetShapeFixParameters(off)
    try:
        yield
    finally:
        reader.SetShapeFixParameters(before)
