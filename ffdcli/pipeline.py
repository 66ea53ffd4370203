"""The stages of a run, in order: mesh and lattice in, exact trimmed surfaces out.

    mesh -> planes -> cut -> regions -> outlines -> patches + curves -> B-rep (-> reduced) ->
    OpenCascade -> file

``prepare`` does all that depends on the mesh and the knots alone. The plan that it returns is
applied to any number of control nets.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import TYPE_CHECKING, Unpack, overload

from ffdcli.brep.geometry import plan_geometry
from ffdcli.brep.occ.targets import TargetName
from ffdcli.brep.reduce_options import require_reducible
from ffdcli.brep.shells import group_shells
from ffdcli.folds.model import place_in_each
from ffdcli.forecast import MANY, Work, count_planned, require_memory, sample_counts
from ffdcli.mesh import Mesh, check_mesh
from ffdcli.mesh_facets import Kept, find_facets
from ffdcli.models import as_mesh, read_lattice
from ffdcli.origin import origin_of
from ffdcli.plan import Plan
from ffdcli.result import Result
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.surface.coplanar import Coplanar
from ffdcli.surface.facets import Patches
from ffdcli.surface.outlines import trace_outlines
from ffdcli.surface.partition import partition
from ffdcli.surface.refine import keep_overshoot_small, keep_weights_positive

if TYPE_CHECKING:
    from ffdcli.keywords import DeformOptions, PlanOptions
    from ffdcli.lattice import Lattice
    from ffdcli.part.plan import PartPlan
    from ffdcli.part.record import Part
    from ffdcli.part.result import PartResult

__all__ = [
    "Coplanar",
    "Kept",
    "Patches",
    "Plan",
    "deform",
    "prepare",
    "read_lattice",
]


@overload
def prepare(mesh: Mesh, lattice: Lattice, **options: Unpack[PlanOptions]) -> Plan: ...


@overload
def prepare(
    mesh: Mesh | Part, lattice: Lattice, **options: Unpack[PlanOptions]
) -> Plan | PartPlan: ...


def prepare(
    mesh: Mesh | Part,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    keep: Collection[Kept] = (),
    coplanar: Coplanar | None = None,
    fit_tolerance: float | None = None,
    require_solid: bool = False,
    once: bool = False,
    work: Work | None = None,
    progress: Progress | None = None,
    warn: Progress | None = None,
) -> Plan | PartPlan:
    """Plan the surfaces of a mesh or a CAD part: all that does not depend on the control net.

    Parameters
    ----------
    mesh, lattice, patches, coplanar, fit_tolerance, require_solid, progress, warn
        As for :func:`deform`. Where the lattice has weights, cuts are added until all surfaces
        have positive weights; the plan then serves nets whose weights are alike.
    keep : collection of {"names", "texture"}
        Divide faces where polygons have different names of groups or bodies, or different maps into
        the texture, so that the triangles of results have them too.
    once : bool
        The plan is for this lattice alone: planes that only another one would bend are not cut, and
        of parts the knots of fits are not found in advance.
    work : Work, optional
        What will be done with the surfaces of a mesh: its memory is foreseen. By default they are
        made and checked.

    Raises
    ------
    MemoryLimitError
        That would take more memory than can be had.
    MeshError
        The mesh has faults that no face can be made of, or options are given that curved faces have
        no use for.
    LatticeError
        The lattice is not settled, or cannot be fitted within the tolerance.
    CheckError
        Surfaces whose weights cannot be made positive, or faces that cannot be fitted.
    """
    limits = coplanar or Coplanar()
    if not isinstance(mesh, Mesh):
        if not mesh.polyhedral:
            # Only parts need these libraries.
            from ffdcli.part.plan import plan_part

            return plan_part(
                mesh,
                lattice,
                fit_tolerance,
                unused={"patches": patches != "merged", "coplanar": limits != Coplanar()},
                require_solid=require_solid,
                once=once,
                progress=progress,
            )
        mesh = as_mesh(mesh)
    stage, work = Stopwatch(progress), work or Work()
    if fit_tolerance is not None:
        from ffdcli.fitting.lattice_fit import require_fit_tolerance

        require_fit_tolerance(fit_tolerance, lattice)
    with stage("check mesh"):
        checked = check_mesh(mesh, require_solid=require_solid)
    nesting = checked.soundness.nesting
    fitted = spent = None
    if lattice.needs_fit:
        from ffdcli.fitting.lattice_fit import fit_lattice
        from ffdcli.fitting.parametrization import parametrize

        with stage("parameters", f"{len(mesh.vertices):,} vertices"):
            spent = parametrize(mesh, lattice)
        with stage("fit"):
            fitted = fit_lattice(mesh, nesting, lattice, fit_tolerance)
    volumes = lattice.volumes if fitted is None else fitted.lattice.volumes
    with stage("planes", f"{len(checked.polygon):,} triangles"):
        facets, vertices = find_facets(checked, volumes, patches, keep, limits)
        sampled = partial(sample_counts, checked, facets, work, spare_planes=once)
        if len(facets.groups.normal) > MANY:
            exact, made = sampled()
            require_memory(work, exact, lambda: made)
    with stage("cut"):
        parts = partition(vertices, checked.triangles, facets)
        parts, cut, depends = keep_overshoot_small(parts, spare_planes=once, warn=warn)
        parts, batches = keep_weights_positive(parts)
    with stage("outlines"):
        outlines = trace_outlines(parts)
        shells = group_shells(nesting, checked.polygon, parts)
    with stage("plan", f"{len(parts.patch):,} faces"):
        geometry = plan_geometry(parts, outlines, batches, shells, mesh.vertices)
        models = place_in_each(mesh, nesting, volumes)
        origin = origin_of(checked, parts, limits)
        exact = count_planned(geometry, volumes, len(checked.triangles))
        memory = require_memory(work, exact, lambda: exact.reduced_as(*sampled()))
    return Plan(
        origin=origin,
        volumes=volumes,
        geometry=geometry,
        models=models,
        seconds=stage.seconds,
        keeps_texture="texture" in keep and mesh.uv is not None,
        fitted=fitted,
        parametrization=spent,
        warnings=cut,
        for_one_net=depends,
        memory=memory,
    )


@overload
def deform(mesh: Mesh, lattice: Lattice, **options: Unpack[DeformOptions]) -> Result: ...


@overload
def deform(
    mesh: Mesh | Part, lattice: Lattice, **options: Unpack[DeformOptions]
) -> Result | PartResult: ...


def deform(
    mesh: Mesh | Part,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    coplanar: Coplanar | None = None,
    tolerance: float | None = None,
    max_degree: int | None = None,
    target: TargetName = "generic",
    fit_tolerance: float | None = None,
    check: bool = True,
    require_solid: bool = False,
    require_injective: bool = False,
    work: Work | None = None,
    progress: Progress | None = None,
    warn: Progress | None = None,
) -> Result | PartResult:
    """Bend a mesh or a CAD part with a lattice into trimmed surfaces.

    A part keeps its topology: each face stays one face. What the lattice does not reach keeps its
    geometry; what has no exact form is fitted. A part of planes and straight edges is deformed as
    the polygon mesh that it is.

    Parameters
    ----------
    mesh : Mesh or Part
    lattice : Lattice
        Settled by the mesh or part.
    patches : {"merged", "bezier", "paper"}
        One surface per planar region; or one Bézier patch per plane and knot box, composed as a
        graph (`bezier`) or interpolated in the frames and degrees of Feng 2002 (`paper`).
    coplanar : Coplanar, optional
        Distance and angle within which polygons count as coplanar; by default what the mesh's
        numbers can tell apart. With a larger distance the result is not exact.
    tolerance : float, optional, model length
        Write fewer control points, certified to stay within this of the exact result; without it
        the result is exact.
    max_degree : int, optional
        With a tolerance: no degree is higher, where need be with more knots; at least 3.
    target : {"generic", "solidworks", "catia", "nx", "fusion", "rhino"}
        The receiver: it caps degrees where the result is reduced and `max_degree` is not given,
        and settles how files are written.
    fit_tolerance : float, optional, model length
        For lattices that are not piecewise polynomial (``embedding: inverse``), and for parts:
        surfaces are fitted within this; 1e-5 of the size by default.
    check : bool
        Check topology, volume, and curves against surfaces before the result is handed out.
    require_solid : bool
        Reject an open mesh, which otherwise gives an open shell.
    require_injective : bool
        Reject a lattice that folds the model over, or that is not proved not to.
    work : Work, optional
        As for :func:`prepare`.
    progress : callable, optional
        Called with the name of each stage as it begins.
    warn : callable, optional
        Called with a warning before the work that it is about; the report has it too.

    Raises
    ------
    MeshError, LatticeError, CheckError, MemoryLimitError
    """
    require_reducible(tolerance, max_degree)
    plan = prepare(
        mesh,
        lattice,
        patches=patches,
        coplanar=coplanar,
        fit_tolerance=fit_tolerance,
        require_solid=require_solid,
        once=True,
        work=work or Work(checked=check, tolerance=tolerance, max_degree=max_degree),
        progress=progress,
        warn=warn,
    )
    return plan.deform(
        lattice,
        tolerance=tolerance,
        max_degree=max_degree,
        target=target,
        check=check,
        require_injective=require_injective,
        progress=progress,
    )
