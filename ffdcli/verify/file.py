"""Verify a written file against its mesh and lattice.

The file is re-read without healing and compared with the deformed mesh, in both directions. The
readers of mesh and lattice, the control points that edits produce, and the choice of the lattice
box of a point are those of `ffd deform`. The arithmetic is not: `verify.direct` evaluates the
deformation and `brep.evaluate` the file, and neither imports what makes surfaces.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.arrays import Floats
from ffdcli.brep.record import Brep
from ffdcli.deformation import Deformation
from ffdcli.errors import FileError
from ffdcli.mesh import Mesh, triangles
from ffdcli.verify import AGREE, DeformedMesh, Verification, from_faces, mesh_bodies, verify
from ffdcli.verify.direct import evaluate_directly
from ffdcli.verify.regions import too_far_by_region

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.part.record import Part

# Default tolerance of files of fitted lattices, as a share of the mesh's size: that of the fit, of
# which verification imports nothing. tests/verify/test_missed_feet.py compares the two.
FIT_TOLERANCE = 1e-5
# Default tolerance, as a share of the mesh's size.
DEFAULT_TOLERANCE = 1e-6
# Largest length that a report may state.
_MAX_STATED = 1e30
# Accuracy of the volume under a deformation that is not polynomial, as a share of the tolerance.
_SHARE = 1e-2
# Samples over the mesh, and over the faces, in addition to those of each triangle and face.
_SAMPLES = 10_000


def verify_file(
    path: str | Path,
    mesh: Mesh,
    lattice: Lattice,
    *,
    tolerance: float | None = None,
    expected_error: float = 0.0,
    bounds: Mapping[int, float] | None = None,
    unit: str | None = None,
) -> Verification:
    """Re-read a CAD file and compare it with the deformed mesh.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh
    lattice : Lattice
        Settled with the mesh.
    tolerance : float, optional, model length
        Largest deviation allowed; by default 1e-6 of the mesh's size, for lattices that are fitted
        the default fit tolerance.
    expected_error : float, model length
        The ``max_error`` that the file's report states. Deviations up to half of it are expected
        and not measured to the last digit.
    bounds : mapping of int to float, optional, model length
        Bounds of the fits of the lattices that were fitted, as the file's report states them; see
        :func:`ffdcli.verify.regions.fit_bounds`. The rest is held to the tolerance less the
        largest of them.
    unit : str, optional
        Unit that the file must state. BREP files state none, so it is assumed for them.

    Raises
    ------
    FileError, KernelError
        The file cannot be read.
    """
    from ffdcli.brep.occ.check import kernel_check
    from ffdcli.brep.occ.reading.read import read_cad, record_of

    model = read_cad(path)
    share = FIT_TOLERANCE if lattice.needs_fit else DEFAULT_TOLERANCE
    allowed = share * mesh.size if tolerance is None else tolerance
    deformation = evaluate_directly(Deformation.of(lattice, mesh.delta))
    read = record_of(model)
    verdict = verify(
        read,
        kernel_check(model.shape).valid,
        mesh,
        deformation,
        allowed,
        samples=_SAMPLES,
        expected_error=expected_error,
        # No quadrature rule is exact if the deformation has no polynomial pieces.
        agree=_SHARE * allowed / mesh.size if deformation.needs_fit else AGREE,
        unit=model.unit or unit or lattice.unit or mesh.unit or "mm",
    )
    if bounds and verdict.passed:
        found = too_far_by_region(read, mesh, deformation, allowed, bounds, _SAMPLES)
        verdict = replace(verdict, passed=not found, reasons=tuple(found))
    if unit is not None and verdict.unit != unit:
        reason = f"the file is in {verdict.unit}, not in {unit}"
        verdict = replace(verdict, passed=False, reasons=(*verdict.reasons, reason))
    return verdict


def face_deviations(brep: Brep, mesh: Mesh, lattice: Lattice) -> Floats:
    """Largest distance of each face of a result from the deformed mesh, at sample points.

    Parameters
    ----------
    brep : Brep
    mesh : Mesh
    lattice : Lattice
        Settled with the mesh.

    Returns
    -------
    (F,) float64, model length
        Includes rounding errors.
    """
    corners, _ = triangles(mesh)
    deformation = evaluate_directly(Deformation.of(lattice, mesh.delta))
    image = DeformedMesh(mesh.vertices[corners], mesh_bodies(corners)[2], deformation)
    return from_faces(brep, image, mesh.size, _SAMPLES)


def allowed_deviation(report: Any, path: str | Path, model: Mesh | Part) -> float:
    """Deviation that a report of ``ffd deform`` allows its file, model length.

    At least the distance within which vertices count as coplanar, a billionth of the model's size.

    Raises
    ------
    FileError
        The mapping is not such a report.
    """
    fields = ("max_error", "plane_deviation", "interpolation_error")
    known = {"interpolation_error": 0.0, **report} if isinstance(report, Mapping) else {}
    if "part" in known:
        known = {"plane_deviation": 0.0, **known}
    values = [float(known[name]) for name in fields if _is_length(known.get(name))]
    lacking = "max_error and plane_deviation" if len(values) < len(fields) else ""
    if not lacking and not _has_bounds(known.get("fit")):
        lacking = "bounds in fit.lattices"
    if lacking:
        raise FileError(
            f"this is not a report of ffd deform: it has no {lacking}",
            file=str(path),
            hint="write one with ffd deform --report FILE",
        )
    return float(max(sum(values), 1e-9 * model.size))


def _has_bounds(fit: Any) -> bool:
    """Whether the entry `fit` of a report is None, or holds a bound for each lattice it lists."""
    entries = fit.get("lattices", []) if isinstance(fit, Mapping) else fit
    return entries is None or (
        isinstance(entries, list | tuple)
        and all(isinstance(each, Mapping) for each in entries)
        and all(type(each.get("lattice")) is int for each in entries)
        and all(_is_length(each.get("bound")) for each in entries)
    )


def _is_length(value: Any) -> bool:
    # The bound also refuses whole numbers that are too large for a float.
    return type(value) in (int, float) and 0 <= value <= _MAX_STATED
