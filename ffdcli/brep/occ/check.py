"""OpenCascade's check of a shape (BRepCheck); our own is ffdcli.brep.evaluate.own_check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ffdcli.errors import CheckError

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

NAMED_FAULTS = 8


@dataclass(frozen=True)
class KernelVerdict:
    """Result of OpenCascade's check.

    It accepts inside-out and self-intersecting solids; ``brep.evaluate.own_check`` checks
    orientation and volume.

    Parameters
    ----------
    valid : bool
        BRepCheck finds no fault.
    closed : bool
        There is a shell, and every shell is closed by shared edges.
    faults : tuple of str
        The first few faults, such as ``face 3: UnorientableShape``; numbers count from 0 in
        the order of the shape.
    """

    valid: bool
    closed: bool
    faults: tuple[str, ...]

    def require(self, closed: bool, hint: str) -> None:
        """Reject a shape that is not valid, or not closed where it should be.

        Raises
        ------
        CheckError
            Naming the first few faults.
        """
        if not self.valid or self.closed != closed:
            named = "; ".join(self.faults) or "a shell that should be closed is open"
            raise CheckError(f"OpenCascade does not accept the result: {named}", hint=hint)


def kernel_check(shape: TopoDS_Shape) -> KernelVerdict:
    """Check with OpenCascade whether a shape is valid and closed.

    Returns
    -------
    KernelVerdict
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    analyzer = BRepCheck_Analyzer(shape, True)
    valid = bool(analyzer.IsValid())
    shells = _parts(shape, Kind.TopAbs_SHELL)
    closed = bool(shells) and all(BRep_Tool.IsClosed_s(shell) for shell in shells)
    return KernelVerdict(valid, closed, () if valid else _faults(analyzer, shape))


def _parts(shape: TopoDS_Shape, kind: Any) -> list[Any]:
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


def _faults(analyzer: Any, shape: TopoDS_Shape) -> tuple[str, ...]:
    """Faulty parts and their statuses, outermost first.

    A part may be valid by itself and faulty as part of another (an edge on a face, a shell of a
    solid), so the statuses in context are included.
    """
    from OCP.BRepCheck import BRepCheck_Status
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind

    fine = BRepCheck_Status.BRepCheck_NoError
    unorientable = BRepCheck_Status.BRepCheck_UnorientableShape
    faults: dict[str, None] = {}
    # The status of faces whose edges are faulty.
    following: dict[str, None] = {}
    for name in ("solid", "shell", "face", "wire", "edge", "vertex"):
        for number, part in enumerate(_parts(shape, getattr(Kind, f"TopAbs_{name.upper()}"))):
            result = analyzer.Result(part)
            statuses = list(result.Status())
            result.InitContextIterator()
            while result.MoreShapeInContext():
                statuses.extend(result.StatusOnShape())
                result.NextShapeInContext()
            for status in statuses:
                if status != fine:
                    kind = faults if status != unorientable else following
                    kind[f"{name} {number}: {status.name.removeprefix('BRepCheck_')}"] = None
            if len(faults) >= NAMED_FAULTS:
                return tuple(faults)[:NAMED_FAULTS]
    return (*faults, *following)[:NAMED_FAULTS]
