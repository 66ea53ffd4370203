"""Report of `ffd deform --dry-run`: what a run would make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ffdcli.estimate import estimate
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
    kind: str,
    check: bool,
    require_solid: bool,
    progress: Callable[[str], None],
    warn: Callable[[str], None],
) -> dict[str, Any]:
    """What a run would make, from its plan alone.

    Parameters
    ----------
    model, lattice, patches, coplanar, fit_tolerance, target, require_solid, progress, warn
        As for :func:`ffdcli.deform`.
    kind : {"STEP", "IGES", "BREP"}
    check : bool
        Whether the run would check its result.
    """
    plan = prepare(
        model,
        lattice,
        patches=patches,
        coplanar=coplanar,
        fit_tolerance=fit_tolerance,
        require_solid=require_solid,
        once=True,
        progress=progress,
        warn=warn,
    )
    about = {"dry_run": True, "format": kind}
    if not isinstance(plan, Plan):
        progress("faces")
        return about | _of_part(plan, lattice, target)
    found = estimate(plan, lattice, kind=kind, check=check)
    return {
        **about,
        **asdict(found),
        "seconds": round(found.seconds, 1),
        "warnings": [*plan.origin.checked.mesh.notes, *lattice.warnings, *plan.warnings],
    }


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
