"""Verifying a written file: the other path, which shares nothing with the making of it.

file -> re-read, nothing healed -> plain arrays -> compared with mesh and lattice, both ways
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.brep.record import Floats
from ffdcli.brep.verify import Breaks, Verification, verify
from ffdcli.errors import FileError
from ffdcli.mesh import Mesh, triangles
from ffdcli.volume.bspline import BSplineVolume

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# Share of the mesh's size that a file may deviate by where nothing else is said.
DEFAULT_TOLERANCE = 1e-6
# Points are on the lattice box within this many delta.
_SLACK = 16.0
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
    from ffdcli.brep.occ.read import read_cad, record_of

    model = read_cad(path)
    volume = lattice.volume
    corners, _ = triangles(mesh)
    verdict = verify(
        record_of(model),
        kernel_check(model.shape).valid,
        mesh,
        corners,
        _deformation(volume, _SLACK * mesh.delta),
        _derivatives(volume, _SLACK * mesh.delta),
        _breaks(volume),
        volume.degrees,
        DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance,
        samples=_SAMPLES,
        rational=volume.net.shape[-1] == 4,
        continued=(_deformation(volume, np.inf), _derivatives(volume, np.inf)),
        expected_error=expected_error,
        unit=model.unit or unit or lattice.unit or mesh.unit or "mm",
    )
    if unit is not None and verdict.unit != unit:
        reason = f"the file is in {verdict.unit}, not in {unit}"
        verdict = replace(verdict, passed=False, reasons=(*verdict.reasons, reason))
    return verdict


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


def _deformation(volume: BSplineVolume, slack: float) -> Callable[[Floats], Floats]:
    """Direct evaluation, point by point, in model coordinates.

    Points on the box are inside, and the mesh's own points lie there; a rounding must not carry
    them out. So a point no further from the box than ``slack`` gets the deformation at the nearest
    point of the box, continued by its derivative.
    """
    frame = volume.frame

    def deform(points: Floats) -> Floats:
        local, beyond = _drawn_in(volume, frame.to_local(points), slack)
        images = volume.evaluate(local)
        off = np.flatnonzero(beyond.any(axis=1))
        slopes = volume.jacobian(local[off])
        images[off] += np.einsum("nij,nj->ni", slopes, beyond[off])
        return frame.to_model(images)

    return deform


def _derivatives(volume: BSplineVolume, slack: float) -> Callable[[Floats], Floats]:
    """Jacobians in model coordinates: the frame's axes turn both sides."""
    frame = volume.frame

    def jacobian(points: Floats) -> Floats:
        local = volume.jacobian(_drawn_in(volume, frame.to_local(points), slack)[0])
        return local if frame.aligned else frame.axes.T @ local @ frame.axes

    return jacobian


def _drawn_in(volume: BSplineVolume, local: Floats, slack: float) -> tuple[Floats, Floats]:
    """Points (n, 3) with those close to the box moved onto it, and what they were moved by."""
    nearest = np.clip(local, volume.box[0], volume.box[1])
    close = (np.abs(local - nearest) <= slack).all(axis=1, keepdims=True)
    return np.where(close, nearest, local), np.where(close, local - nearest, 0.0)


def _breaks(volume: BSplineVolume) -> Breaks:
    box, frame = volume.box, volume.frame
    u, v, w = (
        np.unique(np.concatenate([box[:, axis], volume.knot_planes(axis, box).values]))
        for axis in range(3)
    )
    return Breaks(frame.origin, frame.axes, (u, v, w))
