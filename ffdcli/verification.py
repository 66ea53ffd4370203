"""Verifying a written file: the other path, which shares nothing with the making of it.

file -> re-read, nothing healed -> plain arrays -> compared with mesh and lattice, both ways
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.brep.record import Floats, Ints
from ffdcli.brep.verify import Breaks, Verification, verify
from ffdcli.errors import FileError
from ffdcli.mesh import Mesh, triangles
from ffdcli.volume.protocol import Volume

if TYPE_CHECKING:
    from ffdcli.lattice import AnyLattice

# Share of the mesh's size that a file may deviate by where nothing else is said.
DEFAULT_TOLERANCE = 1e-6
# Points are on the lattice box within this many delta.
_SLACK = 16.0
# Samples over the mesh and over the faces, beyond one for every triangle and some for every face.
_SAMPLES = 10_000


def verify_file(
    path: str | Path,
    mesh: Mesh,
    lattice: AnyLattice,
    *,
    tolerance: float | None = None,
    unit: str | None = None,
) -> Verification:
    """Re-read a CAD file and compare it with the deformed mesh.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh
    lattice : Lattice or Lattices
        Settled by the mesh.
    tolerance : float, optional, model length
        Largest deviation allowed; 1e-6 of the mesh's size by default.
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
    volumes = lattice.volumes
    corners, _ = triangles(mesh)
    verdict = verify(
        record_of(model),
        kernel_check(model.shape).valid,
        mesh,
        corners,
        _deformation(volumes, _SLACK * mesh.delta),
        _derivatives(volumes, _SLACK * mesh.delta),
        [_breaks(volume) for volume in volumes],
        max(sum(volume.degrees) for volume in volumes),
        DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance,
        samples=_SAMPLES,
        rational=any(volume.embedding.rational for volume in volumes),
        continued=[
            (_deformation([volume], np.inf), _derivatives([volume], np.inf)) for volume in volumes
        ],
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


def _deformation(volumes: Sequence[Volume], slack: float) -> Callable[[Floats], Floats]:
    """Direct evaluation, point by point, in model coordinates.

    Points on a box are inside, and the mesh's own points lie there; a rounding must not carry
    them out. So a point no further from a box than ``slack`` gets the deformation at the nearest
    point of the box, continued by its derivative. Points near none stay.
    """

    def deform(points: Floats) -> Floats:
        out = np.array(points, dtype=np.float64)
        for volume, mine, local, beyond in _by_box(volumes, points, slack):
            images = volume.evaluate(local)
            off = np.flatnonzero(beyond.any(axis=1))
            slopes = volume.jacobian(local[off])
            images[off] += np.einsum("nij,nj->ni", slopes, beyond[off])
            out[mine] = volume.frame.to_model(images)
        return out

    return deform


def _derivatives(volumes: Sequence[Volume], slack: float) -> Callable[[Floats], Floats]:
    """Jacobians in model coordinates: the frame's axes turn both sides."""

    def jacobian(points: Floats) -> Floats:
        out = np.tile(np.eye(3), (len(points), 1, 1))
        for volume, mine, local, _ in _by_box(volumes, points, slack):
            slopes, frame = volume.jacobian(local), volume.frame
            out[mine] = slopes if frame.aligned else frame.axes.T @ slopes @ frame.axes
        return out

    return jacobian


def _by_box(
    volumes: Sequence[Volume], points: Floats, slack: float
) -> Iterator[tuple[Volume, Ints, Floats, Floats]]:
    """Each volume with the points (m, 3) no further from its box than ``slack``.

    Yields the volume, which points, the nearest points of the box, and what the points lie beyond
    these, both in its frame.
    Where boxes touch a point belongs to the first; there both leave it where it is.
    """
    free = np.ones(len(points), dtype=bool)
    for volume in volumes:
        local = volume.frame.to_local(points)
        nearest = np.clip(local, volume.box[0], volume.box[1])
        mine = np.flatnonzero(free & (np.abs(local - nearest) <= slack).all(axis=1))
        free[mine] = False
        yield volume, mine, nearest[mine], (local - nearest)[mine]


def _breaks(volume: Volume) -> Breaks:
    box, frame = volume.box, volume.frame
    u, v, w = (
        np.unique(np.concatenate([box[:, axis], volume.knot_planes(axis, box[None]).values[0]]))
        for axis in range(3)
    )
    return Breaks(frame.origin, frame.axes, (u, v, w))
