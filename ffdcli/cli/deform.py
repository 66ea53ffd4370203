"""`ffd deform`: mesh and lattice in, exact CAD solid out, or triangles."""

from __future__ import annotations

import json
from contextlib import nullcontext
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
from ffdcli.brep.occ.targets import TARGET_NAMES, TargetName
from ffdcli.cli.options import (
    FILE,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
)
from ffdcli.cli.progress import show_stages
from ffdcli.formats import SUBDIVISIONS, Subdivision, mesh_format
from ffdcli.units import UNIT_NAMES

if TYPE_CHECKING:
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
    required=True,
    help="The file to write: .step, .stp, .iges, .igs or .brep; or a mesh: .stl, .obj, .ply, .off, "
    ".glb or .3mf.",
)
@click.option(
    "--patches",
    type=click.Choice(["merged", "bezier"]),
    help="One surface per planar region, or one Bézier patch per plane and knot box (Feng 2002). "
    "[default: merged]",
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
@click.option("--report", "report_file", type=FILE, help="Write the JSON report to this file too.")
@json_option
@quiet_option
def deform(
    mesh: Path,
    lattice: Path,
    output: Path,
    patches: Patches | None,
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
    report_file: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Deform MESH by LATTICE and write the exact result.

    Every planar region of the mesh becomes one trimmed B-spline surface that *is* the deformation,
    to rounding; a closed mesh becomes a closed solid. The result is checked before it is written.

    Where the output is a mesh, these surfaces are cut into triangles, or the mesh's own triangles
    are; how far they are from the exact surfaces is measured and told.
    """
    to_mesh = mesh_format(output) is not None
    _require_fitting(
        cad_format(output) or ("a mesh format" if to_mesh else None),
        {
            "--patches": (patches, CAD_KINDS),
            "--target": (target, CAD_KINDS),
            "--schema": (schema, ("STEP",)),
            "--iges-mode": (iges_mode, ("IGES",)),
            "--mesh-mode": (mesh_mode, MESH_KINDS),
            "--mesh-tolerance": (mesh_tolerance, MESH_KINDS),
        },
    )
    if mesh_tolerance is not None and not 0 < mesh_tolerance < float("inf"):
        raise click.UsageError("--mesh-tolerance must be a positive length.")
    if mesh_mode == "vertices" and mesh_tolerance is not None:
        raise click.UsageError("--mesh-mode vertices has no use for --mesh-tolerance.")
    from ffdcli.brep.occ.process import KernelProcess
    from ffdcli.files import require_place, write_whole

    if to_mesh:
        from ffdcli.tessellate.result import require_mesh_output

        require_mesh_output(output, unit)
    else:
        require_writable(output)
    if report_file is not None:
        require_place(report_file)
    with (
        show_stages(output.name, quiet=quiet) as progress,
        nullcontext() if to_mesh else KernelProcess() as kernel,
    ):
        # All this loads while that process loads OpenCascade.
        from ffdcli.mesh import read_mesh
        from ffdcli.pipeline import deform as run
        from ffdcli.pipeline import deform_mesh, read_lattice
        from ffdcli.stopwatch import Stopwatch

        stage = Stopwatch(progress)
        with stage("read"):
            record = read_mesh(mesh, repair=repair)
            solved = read_lattice(lattice, record)
        check = not no_check
        result: Result | MeshResult
        if to_mesh:
            result = deform_mesh(
                record,
                solved,
                mode=mesh_mode or "exact",
                tolerance=mesh_tolerance,
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
                check=False,
                require_solid=require_solid,
                require_injective=require_injective,
                progress=progress,
            ).write(
                output,
                unit=unit,
                target=target or "generic",
                schema=schema,
                iges_mode=iges_mode,
                check=check,
                progress=progress,
                kernel=kernel,
            )
    report = result.report
    report["seconds"] = {"read": round(stage.seconds["read"], 4), **report["seconds"]}
    print_warnings(report["warnings"], quiet=quiet)
    if report_file is not None:
        write_whole(report_file, (json.dumps(report, indent=2, ensure_ascii=False) + "\n").encode())
    if as_json:
        print_json(report)
    else:
        click.echo(_mesh_summary(report) if to_mesh else _summary(report))


def _require_fitting(kind: str | None, options: dict[str, tuple[Any, tuple[str, ...]]]) -> None:
    """Refuse options given for an output of another kind."""
    for option, (value, kinds) in options.items():
        if value is not None and kind not in kinds:
            fitting = " or ".join(kinds)
            raise click.UsageError(f"{option} goes with an output in {fitting}.")


def _summary(report: dict[str, Any]) -> str:
    """Three lines for people."""
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    degrees = ", ".join(
        f"{count} plane{'s' * (count > 1)}" if name == "plane" else f"{count} of degree {name}"
        for name, count in report["degrees"].items()
    )
    return (
        f"{report['output']}: {what}, {_counted(report['faces'], 'face')} ({degrees}), "
        f"{_counted(report['control_points'], 'control point')}, {_amount(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"exact: faces follow the deformed mesh to {max(report['plane_deviation'], 0):.1e} "
        f"{report['unit']} or rounding, whichever is larger\n"
        f"{_folding(report['jacobian'])}"
    )


def _mesh_summary(report: dict[str, Any]) -> str:
    """Two lines for people."""
    what = "closed" if report["watertight"] else "open"
    return (
        f"{report['output']}: {what}, {_counted(report['triangles'], 'triangle')}, "
        f"{_counted(report['vertices'], 'vertex')}, {_amount(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"approximate: the exact surface is up to {report['max_deviation']:.2g} {report['unit']} "
        "from the triangles (sampled densely)"
    )


def _amount(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


def _folding(jacobian: dict[str, Any]) -> str:
    """One line on injectivity."""
    if jacobian["injective"] == "no":
        place = ", ".join(f"{x:.6g}" for x in jacobian["at"])
        return f"folded over: det J is {jacobian['value']:.3g} at ({place}), maybe elsewhere too"
    if jacobian["injective"] == "unproved":
        return "not proved that nothing is folded over"
    sense = "-det J" if jacobian.get("mirrored") else "det J"
    proved = f"nothing is folded over: {sense} is at least {jacobian['bound']:.3g} in the model"
    if jacobian["global"] == "yes":
        return f"{proved}, and no two points of it meet"
    return f"{proved}; not proved that parts far apart do not meet"


def _counted(count: int, noun: str) -> str:
    plural = {"vertex": "vertices"}.get(noun, f"{noun}s")
    return f"{count} {noun if count == 1 else plural}"
