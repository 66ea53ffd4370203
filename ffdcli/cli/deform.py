"""Command `ffd deform`: deform a mesh by a lattice, and write CAD or a mesh."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli import option_texts as texts
from ffdcli.brep.occ.formats import (
    CHECKS,
    IGES_MODES,
    SCHEMAS,
    WRITERS,
    Checks,
    IgesMode,
    Schema,
    Writer,
    cad_format,
)
from ffdcli.brep.occ.processes.process import KernelProcess
from ffdcli.brep.occ.targets import TARGET_NAMES, TargetName
from ffdcli.cli.deform_options import reject_for_curved, reject_wrong_usage, require_places
from ffdcli.cli.deform_summary import parametrization_lines, summary
from ffdcli.cli.options import (
    ANGLE,
    FILE,
    LENGTH,
    json_option,
    memory_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
    say_lines,
)
from ffdcli.cli.profile import Profile
from ffdcli.cli.progress import show_stages
from ffdcli.formats import SUBDIVISIONS, Subdivision, mesh_format
from ffdcli.messages import json_text
from ffdcli.units import UNIT_NAMES

if TYPE_CHECKING:
    from ffdcli.part.result import PartResult
    from ffdcli.pipeline import Patches
    from ffdcli.result import Result
    from ffdcli.tessellate.mesh_result import MeshResult


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option(
    "-o",
    "--output",
    "output",
    type=FILE,
    help="File to write, by its extension: CAD (.step, .stp, .iges, .igs, .brep) or a mesh (.stl, "
    ".obj, .ply, .off, .glb, .3mf). Required, except with --dry-run.",
)
@click.option("--patches", type=click.Choice(["merged", "bezier", "paper"]), help=texts.PATCHES)
@click.option("--coplanar-distance", type=LENGTH, help=texts.COPLANAR_DISTANCE)
@click.option("--coplanar-angle", type=ANGLE, help=texts.COPLANAR_ANGLE)
@click.option("--tolerance", type=LENGTH, help=texts.TOLERANCE)
@click.option("--max-degree", type=click.IntRange(min=3), help=texts.MAX_DEGREE)
@click.option("--fit-tolerance", type=LENGTH, help=texts.FIT_TOLERANCE)
@click.option("--unit", type=click.Choice(UNIT_NAMES), help=texts.UNIT)
@click.option("--target", type=click.Choice(TARGET_NAMES), help=texts.TARGET)
@click.option("--schema", type=click.Choice(SCHEMAS), help=texts.SCHEMA)
@click.option("--iges-mode", type=click.Choice(IGES_MODES), help=texts.IGES_MODE)
@click.option("--writer", type=click.Choice(WRITERS), help=texts.WRITER)
@click.option(
    "--mesh-mode",
    type=click.Choice(SUBDIVISIONS),
    help="For mesh output, deform the vertices of the input mesh: as it is (`vertices`), with all "
    "triangles halved until they are within the tolerance (`uniform`), or only those that need it "
    "(`adaptive`). Default: triangulate the exact surfaces.",
)
@click.option(
    "--mesh-tolerance",
    type=LENGTH,
    metavar="T",
    help="For mesh output: largest distance from the exact surfaces, in model units. Default: "
    "2e-4 of the mesh size.",
)
@repair_option
@click.option("--require-solid", is_flag=True, help=texts.REQUIRE_SOLID)
@click.option("--require-injective", is_flag=True, help=texts.REQUIRE_INJECTIVE)
@click.option("--check", "checks", type=click.Choice(CHECKS), help=texts.CHECKS)
@click.option("--no-check", is_flag=True, help="Do not check the result before it is written.")
@click.option(
    "--dry-run",
    is_flag=True,
    help="Do not deform: cut the mesh, and estimate the size of the result and the time needed. Of "
    "a CAD part: how many faces stay, are exact or are to be fitted, and whether it is folded.",
)
@click.option("--profile", is_flag=True, help="Print the seconds and peak memory of each stage.")
@memory_option
@click.option("--report", "report_file", type=FILE, help="Write the JSON report to this file too.")
@json_option
@quiet_option
def deform(
    mesh: Path,
    lattice: Path,
    output: Path | None,
    patches: Patches | None,
    coplanar_distance: float | None,
    coplanar_angle: float | None,
    tolerance: float | None,
    max_degree: int | None,
    fit_tolerance: float | None,
    unit: str | None,
    target: TargetName | None,
    schema: Schema | None,
    iges_mode: IgesMode | None,
    writer: Writer | None,
    mesh_mode: Subdivision | None,
    mesh_tolerance: float | None,
    repair: bool,
    require_solid: bool,
    require_injective: bool,
    checks: Checks | None,
    no_check: bool,
    dry_run: bool,
    profile: bool,
    report_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Deform MESH by LATTICE and write the result.

    CAD output is exact: each planar region of the mesh becomes one trimmed B-spline surface that
    equals the deformation up to rounding. A closed mesh becomes a closed solid. The result is
    checked before it is written. With --tolerance the file is smaller, and stays within a certified
    distance of the exact result.

    MESH may be a CAD part too. Its faces, edges, names, colours and assembly stay. Faces that the
    lattice does not reach keep their geometry; what has no exact form is fitted within
    --fit-tolerance, and the measured bound is printed.

    Mesh output consists of triangles. Their largest distance from the exact surfaces is measured
    and printed.
    """
    to_mesh = None if output is None else mesh_format(output)
    if output is None and not dry_run:
        raise click.MissingParameter(param_type="option", param_hint="'-o' / '--output'")
    kind = None if output is None else cad_format(output)
    reject_wrong_usage(
        "a mesh format" if to_mesh else kind,
        {
            "--patches": patches,
            "--coplanar-distance": coplanar_distance,
            "--coplanar-angle": coplanar_angle,
            "--tolerance": tolerance,
            "--max-degree": max_degree,
            "--fit-tolerance": fit_tolerance,
            "--target": target,
            "--schema": schema,
            "--iges-mode": iges_mode,
            "--writer direct": writer if writer == "direct" else None,
            "--check": checks,
            "--no-check": no_check or None,
            "--mesh-mode": mesh_mode,
            "--mesh-tolerance": mesh_tolerance,
            "--dry-run": dry_run or None,
            "--require-injective": require_injective or None,
        },
    )
    require_places(output, unit, report_file)
    said: list[str] = []

    def warn(text: str) -> None:
        said.append(text)
        print_warnings([text], quiet=quiet)

    with ExitStack() as stack:
        begin = stack.enter_context(show_stages((output or mesh).name, quiet=quiet))
        # OpenCascade loads in a process of its own while this one works; only CAD files need it.
        # A part has been read by this process, which writes it too.
        unasked = writer == "direct" and checks != "kernel"
        alone = to_mesh or dry_run or unasked or cad_format(mesh)
        kernel = None if alone else stack.enter_context(KernelProcess())
        numbers = (os.getpid(), *([] if kernel is None else [kernel.number]))
        stages = Profile(numbers, begin) if profile else None
        progress = stages or begin
        from ffdcli.stopwatch import Stopwatch

        stage = Stopwatch(progress)
        with stage("read"):
            from ffdcli.cli.dry_run import dry_run_report
            from ffdcli.forecast import Work
            from ffdcli.mesh import Mesh
            from ffdcli.models import read_model
            from ffdcli.pipeline import Coplanar, read_lattice
            from ffdcli.pipeline import deform as run
            from ffdcli.triangles import deform_mesh

            model = read_model(mesh, repair=repair)
            solved = read_lattice(lattice, model)
        if not isinstance(model, Mesh) and not model.polyhedral:
            reject_for_curved(
                {
                    "--mesh-mode": mesh_mode,
                    "--patches": patches,
                    "--coplanar-distance": coplanar_distance,
                    "--coplanar-angle": coplanar_angle,
                    "--writer direct": writer if writer == "direct" else None,
                    "--check": checks,
                },
            )
        check = not no_check
        work = Work.writing(
            output or "a.step",
            writer or "kernel",
            checks or check,
            tolerance=tolerance,
            max_degree=max_degree,
        )
        coplanar = Coplanar(coplanar_distance, coplanar_angle)
        result: Result | PartResult | MeshResult
        if dry_run or output is None:
            report = dry_run_report(
                model,
                solved,
                patches=patches or "merged",
                coplanar=coplanar,
                fit_tolerance=fit_tolerance,
                target=target or "generic",
                work=work,
                require_solid=require_solid,
                progress=progress,
                warn=warn,
            )
        else:
            if to_mesh:
                result = deform_mesh(
                    model,
                    solved,
                    mode=mesh_mode or "exact",
                    tolerance=mesh_tolerance,
                    keep=to_mesh.keeps,
                    fit_tolerance=fit_tolerance,
                    check=check,
                    require_solid=require_solid,
                    require_injective=require_injective,
                    progress=progress,
                    warn=warn,
                ).write(output, unit=unit, progress=progress)
            else:
                # `write` runs our own check while OpenCascade runs its check.
                how: dict[str, Any] = {} if kernel is None else {"kernel": kernel}
                result = run(
                    model,
                    solved,
                    patches=patches or "merged",
                    coplanar=coplanar,
                    tolerance=tolerance,
                    max_degree=max_degree,
                    target=target or "generic",
                    fit_tolerance=fit_tolerance,
                    check=False,
                    require_solid=require_solid,
                    require_injective=require_injective,
                    work=work,
                    progress=progress,
                    warn=warn,
                ).write(
                    output,
                    unit=unit,
                    schema=schema,
                    iges_mode=iges_mode,
                    writer=writer or "kernel",
                    check=checks or check,
                    progress=progress,
                    **how,
                )
            report = result.report
            report["seconds"] = {"read": round(stage.seconds["read"], 4), **report["seconds"]}
        if stages is not None:
            stages.end()
            report["profile"] = stages.as_json()
    _print_report(report, said, stages, report_file, as_json=as_json, quiet=quiet)


def _print_report(
    report: dict[str, Any],
    said: list[str],
    stages: Profile | None,
    report_file: Path | None,
    *,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print the report, without the warnings said already, and write it to a file if asked for."""
    from ffdcli.files import write_whole

    print_warnings([each for each in report["warnings"] if each not in said], quiet=quiet)
    if report_file is not None:
        write_whole(report_file, (json_text(report, indent=2) + "\n").encode())
    if stages is not None:
        say_lines("\n".join([stages.as_text(), *parametrization_lines(report)]), err=True)
    if as_json:
        print_json(report)
    else:
        say_lines(summary(report))
