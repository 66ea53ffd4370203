"""`ffd deform`: mesh and lattice in, exact CAD solid out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import click

from ffdcli.brep.occ.formats import IGES_MODES, SCHEMAS, IgesMode, Schema, cad_format
from ffdcli.cli.options import FILE, json_option, print_json, print_warnings, quiet_option
from ffdcli.cli.progress import show_stages
from ffdcli.units import UNIT_NAMES


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option(
    "-o",
    "--output",
    "output",
    type=FILE,
    required=True,
    help="The file to write: .step, .stp, .iges, .igs or .brep.",
)
@click.option(
    "--patches",
    type=click.Choice(["merged", "bezier"]),
    default="merged",
    show_default=True,
    help="One surface per planar region, or one Bézier patch per plane and knot box (Feng 2002).",
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
@click.option("--report", "report_file", type=FILE, help="Write the JSON report to this file too.")
@json_option
@quiet_option
def deform(
    mesh: Path,
    lattice: Path,
    output: Path,
    patches: Literal["merged", "bezier"],
    tolerance: float | None,
    max_degree: int | None,
    unit: str | None,
    schema: Schema | None,
    iges_mode: IgesMode | None,
    require_solid: bool,
    no_check: bool,
    report_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Deform MESH by LATTICE and write the exact result.

    Every planar region of the mesh becomes one trimmed B-spline surface that *is* the deformation,
    to rounding; a closed mesh becomes a closed solid. The result is checked before it is written.
    With --tolerance the file is smaller, and within a certified bound of the exact one.
    """
    from ffdcli.files import require_place, write_whole
    from ffdcli.mesh import read_mesh
    from ffdcli.pipeline import deform as run
    from ffdcli.pipeline import read_lattice
    from ffdcli.result import require_writable
    from ffdcli.stopwatch import Stopwatch

    if max_degree is not None and tolerance is None:
        raise click.UsageError("--max-degree needs --tolerance.")
    for option, value, kind in (("--schema", schema, "STEP"), ("--iges-mode", iges_mode, "IGES")):
        if value is not None and cad_format(output) != kind:
            raise click.UsageError(f"{option} goes with an output in {kind}.")
    require_writable(output)
    if report_file is not None:
        require_place(report_file)
    with show_stages(output.name, quiet=quiet) as progress:
        stage = Stopwatch(progress)
        with stage("read"):
            record = read_mesh(mesh)
            solved = read_lattice(lattice, record)
        check = not no_check
        result = run(
            record,
            solved,
            patches=patches,
            tolerance=tolerance,
            max_degree=max_degree,
            check=check,
            require_solid=require_solid,
            progress=progress,
        )
        result = result.write(
            output,
            unit=unit,
            schema=schema or "ap214",
            iges_mode=iges_mode or "brep",
            check=check,
            progress=progress,
        )
    report = result.report
    report["seconds"] = {"read": round(stage.seconds["read"], 4), **report["seconds"]}
    print_warnings(report["warnings"], quiet=quiet)
    if report_file is not None:
        write_whole(report_file, (json.dumps(report, indent=2, ensure_ascii=False) + "\n").encode())
    if as_json:
        print_json(report)
    else:
        click.echo(_summary(report))


def _summary(report: dict[str, Any]) -> str:
    """Two lines for people."""
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    degrees = ", ".join(
        f"{count} plane{'s' * (count > 1)}" if name == "plane" else f"{count} of degree {name}"
        for name, count in report["degrees"].items()
    )
    size = report["bytes"]
    amount = f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
    off = f"{max(report['plane_deviation'], 0):.1e} {report['unit']} or rounding"
    if report["exact"]:
        bound = f"exact: faces follow the deformed mesh to {off}, whichever is larger"
    else:
        bound = (
            f"reduced: within {report['max_error']:.2e} {report['unit']} of the exact result "
            f"(certified), which follows the deformed mesh to {off}, whichever is larger"
        )
    return (
        f"{report['output']}: {what}, {_counted(report['faces'], 'face')} ({degrees}), "
        f"{_counted(report['control_points'], 'control point')}, {amount}, in {report['unit']}\n"
        f"{bound}"
    )


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
