"""`ffd deform`: mesh and lattice in, exact CAD solid out."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from ffdcli.brep.occ.formats import (
    IGES_MODES,
    SCHEMAS,
    IgesMode,
    Schema,
    cad_format,
    require_writable,
)
from ffdcli.brep.occ.process import KernelProcess
from ffdcli.cli.options import FILE, json_option, print_json, print_warnings, quiet_option
from ffdcli.cli.profile import Profile
from ffdcli.cli.progress import show_stages
from ffdcli.units import UNIT_NAMES

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option(
    "-o",
    "--output",
    "output",
    type=FILE,
    help="The file to write: .step, .stp, .iges, .igs or .brep.  [required, but for --dry-run]",
)
@click.option(
    "--patches",
    type=click.Choice(["merged", "bezier"]),
    default="merged",
    show_default=True,
    help="One surface per planar region, or one Bézier patch per plane and knot box (Feng 2002).",
)
@click.option(
    "--unit",
    type=click.Choice(UNIT_NAMES),
    help="Unit of the numbers, for the header. [default: the lattice's, the mesh's, or mm]",
)
@click.option(
    "--schema",
    type=click.Choice(SCHEMAS),
    help="STEP application protocol. [default: ap214]",
)
@click.option(
    "--iges-mode",
    type=click.Choice(IGES_MODES),
    help="IGES as solids (entity 186) or as trimmed surfaces (144). [default: brep]",
)
@click.option("--require-solid", is_flag=True, help="Refuse a mesh that is not closed.")
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
    patches: Literal["merged", "bezier"],
    unit: str | None,
    schema: Schema | None,
    iges_mode: IgesMode | None,
    require_solid: bool,
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
    """
    from ffdcli.files import require_place

    kind = None if output is None else cad_format(output)
    for option, value, wanted in (("--schema", schema, "STEP"), ("--iges-mode", iges_mode, "IGES")):
        if value is not None and kind not in (None, wanted):
            raise click.UsageError(f"{option} goes with an output in {wanted}.")
    if output is not None:
        require_writable(output)
    elif not dry_run:
        raise click.MissingParameter(param_type="option", param_hint="'-o' / '--output'")
    if report_file is not None:
        require_place(report_file)
    # A dry run asks nothing of OpenCascade, which loads while the rest does.
    with ExitStack() as stack:
        begin = stack.enter_context(
            show_stages(mesh.name if output is None else output.name, quiet=quiet)
        )
        kernel = None if dry_run else stack.enter_context(KernelProcess())
        numbers = (os.getpid(), *([] if kernel is None else [kernel.number]))
        stages = Profile(numbers, begin) if profile else None
        progress = stages or begin
        from ffdcli.stopwatch import Stopwatch

        stage = Stopwatch(progress)
        with stage("read"):
            from ffdcli.mesh import read_mesh
            from ffdcli.pipeline import deform as run
            from ffdcli.pipeline import read_lattice

            record = read_mesh(mesh)
            solved = read_lattice(lattice, record)
        if kernel is None or output is None:
            report = _estimate(
                record, solved, patches, kind or "STEP", not no_check, require_solid, progress
            )
        else:
            # Our own check runs while OpenCascade does its.
            result = run(
                record,
                solved,
                patches=patches,
                check=False,
                require_solid=require_solid,
                progress=progress,
            )
            result = result.write(
                output,
                unit=unit,
                schema=schema or "ap214",
                iges_mode=iges_mode or "brep",
                check=not no_check,
                progress=progress,
                kernel=kernel,
            )
            report = result.report
            report["seconds"] = {"read": round(stage.seconds["read"], 4), **report["seconds"]}
        if stages is not None:
            stages.end()
            report["profile"] = stages.as_json()
    _say(report, stages, report_file, as_json=as_json, quiet=quiet)


def _estimate(
    mesh: Mesh,
    lattice: Lattice,
    patches: Literal["merged", "bezier"],
    kind: str,
    check: bool,
    require_solid: bool,
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """The report of a dry run."""
    from ffdcli.estimate import estimate
    from ffdcli.mesh import inspect, require_closed
    from ffdcli.pipeline import prepare

    if require_solid:
        require_closed(mesh, inspect(mesh))
    plan = prepare(mesh, lattice, patches=patches, progress=progress)
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
    elif "dry_run" in report:
        click.echo(
            f"dry run: {_counted(report['faces'], 'face')}, "
            f"{_counted(report['control_points'], 'control point')}, about "
            f"{_amount(report['bytes'])} of {report['format']} in {report['seconds']:.0f} s"
        )
    else:
        click.echo(_summary(report))


def _summary(report: dict[str, Any]) -> str:
    """Two lines for people."""
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    degrees = ", ".join(
        f"{count} plane{'s' * (count > 1)}" if name == "plane" else f"{count} of degree {name}"
        for name, count in report["degrees"].items()
    )
    return (
        f"{report['output']}: {what}, {_counted(report['faces'], 'face')} ({degrees}), "
        f"{_counted(report['control_points'], 'control point')}, "
        f"{_amount(report['bytes'])}, in {report['unit']}\n"
        f"exact: faces follow the deformed mesh to {max(report['plane_deviation'], 0):.1e} "
        f"{report['unit']} or rounding, whichever is larger"
    )


def _amount(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
