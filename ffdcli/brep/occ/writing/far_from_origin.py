"""STEP files of models so far from the origin that rounding makes OpenCascade's reader fail."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.brep.occ.settings import silent_kernel
from ffdcli.errors import CheckError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

# OpenCascade's reader requires a point of a curve, evaluated twice, to be the same within this.
_CONFUSION = 1e-7
# Evaluations of a point differ by at most some such units in the last place.
_ULPS = 16


def require_parts(shape: TopoDS_Shape, content: bytes) -> None:
    """Reject a STEP file of large coordinates that OpenCascade makes no shape of.

    Only where rounding may exceed what its reader allows is the file read in full.

    Raises
    ------
    CheckError
        With the largest coordinate, and its rounding.
    """
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    corners = (*box.CornerMin().Coord(), *box.CornerMax().Coord())
    largest = max(map(abs, corners))
    if _is_doubtful(largest):
        _require_parts(largest, lambda reader: reader.ReadStream("model", BytesIO(content)))


def require_parts_in(path: Path, largest: float) -> None:
    """Reject a STEP file whose largest coordinate this is, likewise."""
    if _is_doubtful(largest):
        _require_parts(largest, lambda reader: reader.ReadFile(str(path)))


def _is_doubtful(largest: float) -> bool:
    return _ULPS * float(np.spacing(largest)) >= _CONFUSION


def _require_parts(largest: float, load: Callable[[Any], Any]) -> None:
    from OCP.STEPControl import STEPControl_Reader

    with silent_kernel():
        reader = STEPControl_Reader()
        load(reader)
        roots = reader.NbRootsForTransfer()
        made = reader.TransferRoots()
    if made < roots:
        raise CheckError(
            f"OpenCascade makes only {made} of the {roots} parts of the STEP file: the model has"
            f" coordinates of {largest:.3g}, rounded by {np.spacing(largest):.2g}, and its reader"
            f" requires points to agree within {_CONFUSION:g}",
            hint="move the model nearer to the origin, or write .brep or .iges",
        )
