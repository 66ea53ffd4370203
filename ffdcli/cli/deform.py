"""`ffd deform`: mesh and lattice in, exact CAD solid out, or triangles."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli.brep.occ.formats import (
    CAD_FORMATS,
    IGES_MODES,
    SCHEMAS,
    IgesMode,
    Schema,
    cad_format,
    require_writable,
)
from ffdcli.brep.occ.processes.process import KernelProcess
from ffdcli.brep.occ.targets import TARGET_NAMES, TargetName
from ffdcli.cli.options import (
    FILE,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
)
from ffdcli.cli.profile import Profile
from ffdcli.cli.progress import show_stages
from ffdcli.cli.summary import summary
from ffdcli.formats import SUBDIVISIONS, Subdivision, mesh_format
from ffdcli.units import UNIT_NAMES

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.pipeline import Patches
    from ffdcli.result import Result
    from ffdcli.tessellate.result import MeshResult

CAD_KINDS = tuple(dict.fromkeys(CAD_FORMATS.values()))
MESH_KINDS = ("a mesh format",)


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option(
    "-o",
    "--output",
    "output",
    type=FILE,
    help="The file to write: .step, .stp, .iges, .igs or .brep; or a mesh: .stl, .obj, .ply, .off, "
    ".glb or .3mf.  [required, but for --dry-run]",
)
@click.option(
    "--patches",
    type=click.Choice(["merged", "bezier"]),
    help="One surface per planar region, or one Bézier patch per plane and knot box (Feng 2002). "
    "[default: merged]",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="Write fewer control points, certified to stay within this distance of the exact result "
    "(model units). [default: exact]",
)
@click.option(
    "--max-degree",
    type=click.IntRange(min=3),
    help="With --tolerance: no degree is higher; knots are added where that needs it.",
)
@click.option(
    "--fit-tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="For volumes that are fitted (embedding: inverse): how far the surfaces may be from the "
    "deformed mesh (model units). [default: 1e-5 x size of the mesh]",
)
@click.option(
    "--unit",
    type=click.Choice(UNIT_NAMES),
    help="Unit of the numbers, for the header. [default: the lattice's, the mesh's, or mm]",
)
@click.option(
    "--target",
    type=click.Choice(TARGET_NAMES),
    help="The program that will read the file: decides the options below that are not given. "
    "[default: generic]",
)
@click.option(
    "--schema",
    type=click.Choice(SCHEMAS),
    help="STEP application protocol. [default: the target's, ap214]",
)
@click.option(
    "--iges-mode",
    type=click.Choice(IGES_MODES),
    help="IGES as solids (entity 186) or as trimmed surfaces (144). [default: the target's]",
)
@click.option(
    "--mesh-mode",
    type=click.Choice(SUBDIVISIONS),
    help="For a mesh: the input's triangles with their vertices deformed, halved throughout, or "
    "halved where they need it. [default: new triangles of the exact surfaces]",
)
@click.option(
    "--mesh-tolerance",
    type=float,
    metavar="T",
    help="For a mesh: how far it may be from the exact surfaces, in the model's unit. "
    "[default: 2e-4 of the mesh's size]",
)
@repair_option
@click.option("--require-solid", is_flag=True, help="Refuse a mesh that is not closed.")
@click.option(
    "--require-injective",
    is_flag=True,
    help="Refuse a lattice that folds the model over, or where the contrary cannot be proved.",
)
@click.option(
    "--no-check", is_flag=True, help="Skip the checks of the result before it is written."
)
@click.option(
    "--dry-run", is_flag=True, help="Only cut, and say what would be made, how large, how long."
)
@click.option("--profile", is_flag=True, help="Say what every stage took: seconds, peak memory.")
@click.option("--report", "report_file", type=FILE, help="Write the JSON report to this file too.")
@json_option
@quiet_option
def deform(
    mesh: Path,
    lattice: Path,
    output: Path | None,
    patches: Patches | None,
    tolerance: float | None,
    max_degree: int | None,
    fit_tolerance: float | None,
    unit: str | None,
    target: TargetName | None,
    schema: Schema | None,
    iges_mode: IgesMode | None,
    mesh_mode: Subdivision | None,
    mesh_tolerance: float | None,
    repair: bool,
    require_solid: bool,
    require_injective: bool,
    no_check: bool,
    dry_run: bool,
    profile: bool,
    report_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Deform MESH by LATTICE and write the exact result.

    Every planar region of the mesh becomes one trimmed B-spline surface that *is* the deformation,
    to rounding; a closed mesh becomes a closed solid. The result is checked before it is written.
    With --tolerance the file is smaller, and within a certified bound of the exact one.

    Where the output is a mesh, these surfaces are cut into triangles, or the mesh's own triangles
    are; how far they are from the exact surfaces is measured and told.
    """
    to_mesh = None if output is None else mesh_format(output)
    if output is None and not dry_run:
        raise click.MissingParameter(param_type="option", param_hint="'-o' / '--output'")
    kind = None if output is None else cad_format(output)
    _require_fitting(
        "a mesh format" if to_mesh else kind,
        {
            "--patches": (patches, CAD_KINDS),
            "--tolerance": (tolerance, CAD_KINDS),
            "--max-degree": (max_degree, CAD_KINDS),
            "--target": (target, CAD_KINDS),
            "--schema": (schema, ("STEP",)),
            "--iges-mode": (iges_mode, ("IGES",)),
            "--mesh-mode": (mesh_mode, MESH_KINDS),
            "--mesh-tolerance": (mesh_tolerance, MESH_KINDS),
            "--dry-run": (dry_run or None, CAD_KINDS),
        },
    )
    if max_degree is not None and tolerance is None:
        raise click.UsageError("--max-degree needs --tolerance.")
    if dry_run and tolerance is not None:
        raise click.UsageError("--dry-run does not tell what --tolerance would save.")
    if dry_run and require_injective:
        raise click.UsageError("--dry-run does not look whether the lattice folds the model.")
    if mesh_tolerance is not None and not 0 < mesh_tolerance < float("inf"):
        raise click.UsageError("--mesh-tolerance must be a positive length.")
    if mesh_mode is not None and fit_tolerance is not None:
        raise click.UsageError(f"--mesh-mode {mesh_mode} fits nothing: leave --fit-tolerance out.")
    if mesh_mode == "vertices" and mesh_tolerance is not None:
        raise click.UsageError("--mesh-mode vertices has no use for --mesh-tolerance.")
    _require_places(output, unit, report_file)
    with ExitStack() as stack:
        begin = stack.enter_context(show_stages((output or mesh).name, quiet=quiet))
        # What asks nothing of OpenCascade does not load it; the rest loads while it does.
        alone = to_mesh or dry_run
        kernel = None if alone else stack.enter_context(KernelProcess())
        numbers = (os.getpid(), *([] if kernel is None else [kernel.number]))
        stages = Profile(numbers, begin) if profile else None
        progress = stages or begin
        from ffdcli.stopwatch import Stopwatch

        stage = Stopwatch(progress)
        with stage("read"):
            from ffdcli.mesh import read_mesh
            from ffdcli.pipeline import deform as run
            from ffdcli.pipeline import deform_mesh, read_lattice

            record = read_mesh(mesh, repair=repair)
            solved = read_lattice(lattice, record)
        check = not no_check
        result: Result | MeshResult
        if dry_run or output is None:
            report = _estimate(
                record,
                solved,
                patches or "merged",
                fit_tolerance,
                kind or "STEP",
                check,
                require_solid,
                progress,
            )
        else:
            if to_mesh:
                result = deform_mesh(
                    record,
                    solved,
                    mode=mesh_mode or "exact",
                    tolerance=mesh_tolerance,
                    keep=to_mesh.keeps,
                    fit_tolerance=fit_tolerance,
                    check=check,
                    require_solid=require_solid,
                    require_injective=require_injective,
                    progress=progress,
                ).write(output, unit=unit, progress=progress)
            else:
                # Our own check runs while OpenCascade does its.
                result = run(
                    record,
                    solved,
                    patches=patches or "merged",
                    tolerance=tolerance,
                    max_degree=max_degree,
                    target=target or "generic",
                    fit_tolerance=fit_tolerance,
                    check=False,
                    require_solid=require_solid,
                    require_injective=require_injective,
                    progress=progress,
                ).write(
                    output,
                    unit=unit,
                    schema=schema,
                    iges_mode=iges_mode,
                    check=check,
                    progress=progress,
                    kernel=kernel,
                )
            report = result.report
            report["seconds"] = {"read": round(stage.seconds["read"], 4), **report["seconds"]}
        if stages is not None:
            stages.end()
            report["profile"] = stages.as_json()
    _say(report, stages, report_file, as_json=as_json, quiet=quiet)


def _require_fitting(kind: str | None, options: dict[str, tuple[Any, tuple[str, ...]]]) -> None:
    """Refuse options given for an output of another kind."""
    for option, (value, kinds) in options.items():
        if value is not None and kind is not None and kind not in kinds:
            fitting = " or ".join(kinds)
            raise click.UsageError(f"{option} goes with an output in {fitting}.")


def _require_places(output: Path | None, unit: str | None, report_file: Path | None) -> None:
    """Refuse, before any work, files that could not be written."""
    from ffdcli.files import require_place

    if output is not None and mesh_format(output) is not None:
        from ffdcli.tessellate.result import require_mesh_output

        require_mesh_output(output, unit)
    elif output is not None:
        require_writable(output)
    if report_file is not None:
        require_place(report_file)


def _estimate(
    mesh: Mesh,
    lattice: Lattice,
    patches: Patches,
    fit_tolerance: float | None,
    kind: str,
    check: bool,
    require_solid: bool,
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """The report of a dry run."""
    from ffdcli.estimate import estimate
    from ffdcli.pipeline import prepare

    plan = prepare(
        mesh,
        lattice,
        patches=patches,
        fit_tolerance=fit_tolerance,
        require_solid=require_solid,
        progress=progress,
    )
    found = estimate(plan, lattice, kind=kind, check=check)
    return {
        "dry_run": True,
        "format": kind,
        **asdict(found),
        "seconds": round(found.seconds, 1),
        "warnings": [*mesh.notes, *lattice.warnings],
    }


def _say(
    report: dict[str, Any],
    stages: Profile | None,
    report_file: Path | None,
    *,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print and file the report."""
    from ffdcli.files import write_whole

    print_warnings(report["warnings"], quiet=quiet)
    if report_file is not None:
        write_whole(report_file, (json.dumps(report, indent=2, ensure_ascii=False) + "\n").encode())
    if stages is not None:
        click.echo(stages.as_text(), err=True)
    if as_json:
        print_json(report)
    else:
        click.echo(summary(report))
