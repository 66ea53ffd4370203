"""Table 2 of Feng 2002 for any mesh and lattice: the work and the time of each scheme."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ffdcli.compare.subdivide import cut_mesh
from ffdcli.compare.triangular import interpolate_triangles
from ffdcli.lattice import Lattice
from ffdcli.mesh import Mesh
from ffdcli.pipeline import Patches, prepare

# Stages that construct surfaces; checks do not count.
_STAGES = ("planes", "cut", "outlines", "plan", "surfaces")


@dataclass(frozen=True)
class Row:
    """Row of one scheme.

    Parameters
    ----------
    scheme : str
        ``triangular`` (Feng 1998 and 2000), ``paper`` (Feng 2002 in its own frames), ``bezier``
        and ``merged`` (this program).
    sub_polygons : int
        Number of pieces of the cut mesh.
    patches : int
        Number of surfaces inside the lattice box.
    control_points : int
        Number of control points of these surfaces, without planes.
    seconds : float
        Time from the mesh to the control points.
    """

    scheme: str
    sub_polygons: int
    patches: int
    control_points: int
    seconds: float


def compare_schemes(mesh: Mesh, lattice: Lattice) -> tuple[Row, ...]:
    """Run every scheme, and count and time its work (Feng 2002, Table 2).

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Fitted to the mesh.

    Raises
    ------
    MeshError, LatticeError, CheckError
        As for :func:`ffdcli.pipeline.deform`.
    """
    return (
        _triangular(mesh, lattice),
        _paper(mesh, lattice),
        _ours(mesh, lattice, "bezier"),
        _ours(mesh, lattice, "merged"),
    )


def _triangular(mesh: Mesh, lattice: Lattice) -> Row:
    start = time.perf_counter()
    volume = lattice.volume
    pieces, inside = cut_mesh(mesh, volume)
    made = interpolate_triangles(volume, pieces[inside])
    count = int(np.prod(made.control_points.shape[:2]))
    spent = time.perf_counter() - start
    return Row("triangular", len(pieces), len(made.control_points), count, spent)


def _paper(mesh: Mesh, lattice: Lattice) -> Row:
    plan = prepare(mesh, lattice, patches="paper")
    start = time.perf_counter()
    count = patches = 0
    for batch in plan.geometry.patches:
        made = batch.control_points(lattice.volume.net, np.arange(batch.count))
        count += int(np.prod(made.shape[:3]))
        patches += len(made)
    spent = time.perf_counter() - start + plan.seconds["planes"] + plan.seconds["cut"]
    return Row("paper", plan.origin.sub_polygons, patches, count, spent)


def _ours(mesh: Mesh, lattice: Lattice, patches: Patches) -> Row:
    plan = prepare(mesh, lattice, patches=patches)
    result = plan.deform(lattice, check=False)
    report = result.report
    inside = int(plan.geometry.parts.inside.sum())
    spent = sum(result.seconds[stage] for stage in _STAGES)
    return Row(patches, report["sub_polygons"], inside, report["control_points"], spent)
