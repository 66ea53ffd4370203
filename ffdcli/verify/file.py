"""Verifying a written file: the other path, which shares nothing with the making of it.

file -> re-read, nothing healed -> plain arrays -> compared with mesh and lattice, both ways
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.record import Brep
from ffdcli.deformation import Deformation
from ffdcli.errors import FileError
from ffdcli.mesh import Mesh, triangles
from ffdcli.verify import AGREE, Image, Verification, from_faces, mesh_bodies, verify
from ffdcli.verify.direct import evaluate_directly

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# Share of the mesh's size that a file may deviate by where nothing else is said.
DEFAULT_TOLERANCE = 1e-6
# Of the tolerance: what the volume inside a deformation that is no polynomial is known to.
_SHARE = 1e-2
# Samples over the mesh and over the faces, beyond one for every triangle and some for every face.
_SAMPLES = 10_000


def verify_file(
    path: str | Path,
    mesh: Mesh,
    lattice: Lattice,
    *,
    tolerance: float | None = None,
    expected_error: float = 0.0,
    unit: str | None = None,
) -> Verification:
    """Re-read a CAD file and compare it with the deformed mesh.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh
    lattice : Lattice
        Settled by the mesh.
    tolerance : float, optional, model length
        Largest deviation allowed; 1e-6 of the mesh's size by default.
    expected_error : float, model length
        The ``max_error`` that the file's report states: deviations up to half of it are as they
        should be, and not measured to the last digit.
    unit : str, optional
        Unit that the file must state. BREP files state none: it is taken for theirs.

    Raises
    ------
    FileError, KernelError
        The file cannot be read.
    """
    from ffdcli.brep.occ.check import kernel_check
    from ffdcli.brep.occ.reading.read import read_cad, record_of

    model = read_cad(path)
    allowed = DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance
    deformation = evaluate_directly(Deformation.of(lattice, mesh.delta))
    verdict = verify(
        record_of(model),
        kernel_check(model.shape).valid,
        mesh,
        deformation,
        allowed,
        samples=_SAMPLES,
        expected_error=expected_error,
        # Where the deformation has no polynomial pieces no rule is exact, nor needs to be.
        agree=_SHARE * allowed / mesh.size if deformation.needs_fit else AGREE,
        unit=model.unit or unit or lattice.unit or mesh.unit or "mm",
    )
    if unit is not None and verdict.unit != unit:
        reason = f"the file is in {verdict.unit}, not in {unit}"
        verdict = replace(verdict, passed=False, reasons=(*verdict.reasons, reason))
    return verdict


def face_deviations(brep: Brep, mesh: Mesh, lattice: Lattice) -> Floats:
    """How far each face of a result is from the deformed mesh, at points spread over the face.

    Parameters
    ----------
    brep : Brep
    mesh : Mesh
    lattice : Lattice
        Settled by the mesh.

    Returns
    -------
    (F,) float64, model length
        The largest distance found; rounding is not told from none.
    """
    corners, _ = triangles(mesh)
    deformation = evaluate_directly(Deformation.of(lattice, mesh.delta))
    image = Image(mesh.vertices[corners], mesh_bodies(corners)[2], deformation)
    return from_faces(brep, image, mesh.size, _SAMPLES)


def allowed_deviation(report: Any, path: str | Path, mesh: Mesh) -> float:
    """What a report of ``ffd deform`` says its file may deviate by, model length.

    Never less than what counts as coplanar in the mesh: a billionth of its size.

    Raises
    ------
    FileError
        It is no such report.
    """
    fields = ("max_error", "plane_deviation")
    found = [report.get(name) for name in fields] if isinstance(report, Mapping) else []
    values = [value for value in found if isinstance(value, int | float) and 0 <= value < np.inf]
    if len(values) < len(fields):
        raise FileError(
            "this is no report of ffd deform: it states no max_error and plane_deviation",
            file=str(path),
            hint="write one with ffd deform --report FILE",
        )
    return float(max(sum(values), 1e-9 * mesh.size))
