"""Triangles of deformed models: of their exact surfaces, or a mesh's own, deformed."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Literal

from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError, MeshError
from ffdcli.fitting.parametrization import parametrize
from ffdcli.folds.model import place_in_each
from ffdcli.folds.verdict import judge
from ffdcli.formats import Subdivision
from ffdcli.lattice.fit.report import facts_of_fits
from ffdcli.mesh import Mesh, check_mesh, describe
from ffdcli.mesh_facets import Kept
from ffdcli.models import as_mesh
from ffdcli.pipeline import prepare
from ffdcli.plan import Plan, require_injective_lattice, unit_of, warnings_of
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.tessellate.mesh_result import DEFAULT_TOLERANCE, MeshResult, require_whole
from ffdcli.tessellate.subdivided import subdivide_mesh

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.part.record import Part

KEPT: tuple[Kept, ...] = ("names", "texture")
# Largest share of the tolerance of triangles that fits of CAD parts take.
FIT_SHARE = 0.25


def deform_mesh(
    mesh: Mesh | Part,
    lattice: Lattice,
    *,
    mode: Subdivision | Literal["exact"] = "exact",
    tolerance: float | None = None,
    levels: int | None = None,
    keep: Collection[Kept] = KEPT,
    fit_tolerance: float | None = None,
    check: bool = True,
    require_solid: bool = False,
    require_injective: bool = False,
    progress: Progress | None = None,
    warn: Progress | None = None,
) -> MeshResult:
    """Bend a mesh or a CAD part with a lattice into triangles.

    Parameters
    ----------
    mesh, lattice, check, require_solid, require_injective, progress, warn
        As for :func:`ffdcli.deform`.
    fit_tolerance
        Likewise, for `exact`; the other modes deform by the lattice itself.
    mode : {"exact", "vertices", "uniform", "adaptive"}
        `exact`: triangles of the exact surfaces. The others take the mesh's own triangles and
        deform their vertices: `vertices` as they are, `uniform` all halved until they are within
        the tolerance, `adaptive` halved only where they are not within it. Parts with curved faces
        have no triangles of their own.
    tolerance : float, optional, model length
        Largest distance from the exact surface, measured at dense samples; 2e-4 of the mesh's
        size by default. Not for `vertices`.
    levels : int, optional
        For `uniform`: halve this many times, whatever the deviation.
    keep : collection of {"names", "texture"}
        Let no triangle reach from one named group or body, or from one map into the texture, to
        another. Materials are always kept apart.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    if mode == "exact":
        plan = prepare(
            mesh,
            lattice,
            keep=keep,
            fit_tolerance=fit_tolerance,
            require_solid=require_solid,
            once=True,
            progress=progress,
            warn=warn,
        )
        fits = None
        if not isinstance(plan, Plan) and tolerance is not None:
            fits = min(FIT_SHARE * tolerance, plan.tolerance)
        result = plan.deform(
            lattice,
            tolerance=fits,
            check=check,
            require_injective=require_injective,
            progress=progress,
        )
        return result.tessellate(tolerance, progress=progress)
    if not isinstance(mesh, Mesh) and not mesh.polyhedral:
        hint = "leave `mode` out: the faces are then divided within the tolerance"
        raise MeshError(
            "a part with curved faces has no vertices to deform", file=mesh.source, hint=hint
        )
    if fit_tolerance is not None:
        raise LatticeError(f"nothing is fitted for {mode} triangles", file=lattice.source.name)
    return _subdivide(
        as_mesh(mesh),
        lattice,
        mode,
        tolerance,
        levels,
        keep_texture="texture" in keep,
        check=check,
        require_solid=require_solid,
        require_injective=require_injective,
        progress=progress,
    )


def _subdivide(
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
    """Deform the triangles of a mesh; the parameters are those of :func:`deform_mesh`."""
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
