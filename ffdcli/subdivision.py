"""The triangles of a mesh, divided and deformed vertex by vertex."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ffdcli.deformation import Deformation
from ffdcli.fitting.parametrization import parametrize
from ffdcli.folds.model import place_in_each
from ffdcli.folds.verdict import judge
from ffdcli.formats import Subdivision
from ffdcli.lattice.fit.report import facts_of_fits
from ffdcli.mesh import Mesh, check_mesh, describe
from ffdcli.plan import require_injective_lattice, unit_of, warnings_of
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.tessellate.mesh_result import DEFAULT_TOLERANCE, MeshResult, require_whole
from ffdcli.tessellate.subdivided import subdivide_mesh

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice


def subdivide(
    mesh: Mesh,
    lattice: Lattice,
    mode: Subdivision,
    tolerance: float | None,
    levels: int | None,
    *,
    keep_texture: bool,
    check: bool,
    require_solid: bool,
    require_injective: bool,
    progress: Progress | None,
) -> MeshResult:
    """Deform the triangles of a mesh; the parameters are those of :func:`ffdcli.deform_mesh`."""
    stage = Stopwatch(progress)
    with stage("check mesh"):
        checked = check_mesh(mesh, require_solid=require_solid)
    facts = {}
    if lattice.needs_fit:
        with stage("parameters", f"{len(mesh.vertices):,} vertices"):
            facts["parametrization"] = parametrize(mesh, lattice).report
    with stage("jacobian"):
        verdict = judge(lattice, place_in_each(mesh, checked.soundness.nesting, lattice.maps))
        if require_injective:
            require_injective_lattice(verdict, mesh, lattice)
    if mode == "vertices" or levels is not None:
        tolerance = None
    elif tolerance is None:
        tolerance = DEFAULT_TOLERANCE * mesh.size
    with stage("triangles"):
        deformation = Deformation.of(lattice, mesh.delta)
        done = subdivide_mesh(
            checked, deformation, mode, tolerance, levels, keep_texture=keep_texture
        )
        if check and checked.soundness.closed:
            require_whole(done.refined.points, done.triangles)
    return MeshResult(
        mesh=mesh,
        about={"mesh": describe(mesh, checked.soundness)},
        mode=mode,
        rest=done.refined.net.rest,
        points=done.refined.points,
        triangles=done.triangles,
        owner=done.polygon,
        polygon=done.polygon,
        deviation=done.refined.deviation,
        tolerance=tolerance,
        unit=unit_of(mesh, lattice),
        seconds=stage.seconds,
        warnings=tuple(warnings_of(checked, lattice, verdict)),
        facts={**facts, **facts_of_fits(lattice.fits), "jacobian": verdict.report},
        uv=done.uv,
    )
