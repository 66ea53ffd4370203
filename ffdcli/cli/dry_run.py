"""Report of `ffd deform --dry-run`: what a run would make."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ffdcli.estimate import estimate
from ffdcli.forecast import Work
from ffdcli.pipeline import prepare
from ffdcli.plan import Plan

if TYPE_CHECKING:
    from ffdcli.brep.occ.targets import TargetName
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.part.plan import PartPlan
    from ffdcli.part.record import Part
    from ffdcli.pipeline import Coplanar, Patches


def dry_run_report(
    model: Mesh | Part,
    lattice: Lattice,
    *,
    patches: Patches,
    coplanar: Coplanar,
    fit_tolerance: float | None,
    target: TargetName,
    work: Work,
    require_solid: bool,
    progress: Callable[[str], None],
    warn: Callable[[str], None],
) -> dict[str, Any]:
    """What a run would make, from its plan alone.

    Parameters
    ----------
    model, lattice, patches, coplanar, fit_tolerance, target, require_solid, progress, warn
        As for :func:`ffdcli.deform`.
    work : Work
        What the run would do with the surfaces.
    """
    plan = prepare(
        model,
        lattice,
        patches=patches,
        coplanar=coplanar,
        fit_tolerance=fit_tolerance,
        require_solid=require_solid,
        once=True,
        work=Work(checked=False),
        progress=progress,
        warn=warn,
    )
    about = {"dry_run": True, "format": work.kind}
    if not isinstance(plan, Plan):
        progress("faces")
        return about | _of_part(plan, lattice, target)
    found = estimate(plan, lattice, work)
    notes = [*plan.origin.checked.mesh.notes, *lattice.warnings, *plan.warnings]
    if not found.memory.fits:
        notes.append("the run would be refused: it takes more memory than can be had")
    return {**about, **found.report, "warnings": notes}


def _of_part(plan: PartPlan, lattice: Lattice, target: TargetName) -> dict[str, Any]:
    """What is known of a part before anything is fitted."""
    from ffdcli.part.result import describe_part

    part, verdict = plan.part, plan.judge(lattice)
    shares = plan.shares(lattice, target=target)
    return {
        "part": describe_part(part),
        "faces": part.face_count,
        "edges": len(part.edges),
        "faces_by": shares["faces"],
        "edges_by": shares["edges"],
        "fit_tolerance": plan.tolerance,
        "unit": plan.unit_of(lattice),
        "jacobian": verdict.report,
        "warnings": list(plan.warnings(lattice, verdict)),
    }
