"""Verify a written file against the part and the lattice it was made from.

The file is read again without repairs. The readers of part and lattice, the control points that
edits produce, and the choice of the lattice box of a point are those of `ffd deform`. The
arithmetic is not: OpenCascade evaluates the geometry of both, and ``verify.direct`` the
deformation.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ffdcli.deformation import Deformation
from ffdcli.verify.compare import Verification
from ffdcli.verify.direct import evaluate_directly
from ffdcli.verify.file import FIT_TOLERANCE
from ffdcli.verify.part.compare import verify_part

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.part.record import Part


def verify_part_file(
    path: str | Path,
    part: Part,
    lattice: Lattice,
    *,
    tolerance: float | None = None,
    unit: str | None = None,
) -> Verification:
    """Re-read a CAD file and compare it with a deformed part.

    Parameters
    ----------
    path : str or Path
    part : Part
    lattice : Lattice
        Settled with the part.
    tolerance : float, optional, model length
        Largest deviation allowed; by default the default fit tolerance.
    unit : str, optional
        Unit that the file must state. BREP files state none, so it is assumed for them.

    Raises
    ------
    FileError, KernelError
        The file cannot be read.
    """
    from ffdcli.brep.occ.part.document import document_of, root_shapes
    from ffdcli.brep.occ.part.sample import sampled
    from ffdcli.brep.occ.part.validity import read_unrepaired

    document, stated, valid = read_unrepaired(path)
    before = sampled(root_shapes(document_of(part.handle)))
    alone = len(before.face_reversed) == part.face_count
    verdict = verify_part(
        before,
        sampled(root_shapes(document)),
        valid,
        evaluate_directly(Deformation.of(lattice, part.delta)),
        part.size,
        FIT_TOLERANCE * part.size if tolerance is None else tolerance,
        unit=stated or unit or lattice.unit or part.unit or "mm",
        names=part.face_names if alone else (),
    )
    if unit is not None and verdict.unit != unit:
        reason = f"the file is in {verdict.unit}, not in {unit}"
        verdict = replace(verdict, passed=False, reasons=(*verdict.reasons, reason))
    return verdict
