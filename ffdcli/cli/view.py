"""Command `ffd view`: draw a deformation or a CAD file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from ffdcli import option_texts as texts
from ffdcli.cli.options import FILE, LENGTH, print_warnings, quiet_option, repair_option, say
from ffdcli.cli.progress import show_stages
from ffdcli.errors import FileError, LatticeError
from ffdcli.formats import SUBDIVISIONS

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.part.record import Part
    from ffdcli.stopwatch import Progress
    from ffdcli.view.scene import Scene

PICTURES = (".html", ".png")


@click.command()
@click.argument("file", type=FILE, metavar="MESH_OR_CAD")
@click.argument("lattice", type=FILE, required=False)
@click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    help="Picture to write: .html, a self-contained interactive page; or .png.",
)
@click.option(
    "--width",
    type=click.IntRange(200, 8000),
    default=1400,
    help="Width of a .png in pixels. Default: 1400.",
)
@click.option(
    "--compare",
    is_flag=True,
    help="Draw eight panels into a .png: the mesh, subdivision, previous exact methods and this "
    "one (Feng 2002, Figs. 7-13). Prints a table of what each method needs (Table 2 there).",
)
@click.option(
    "--error",
    type=click.Choice([*SUBDIVISIONS, "exact"]),
    help="Draw the distance between a mesh and the exact surface into a .png. The mesh is that of "
    "`ffd deform --mesh-mode`, or `exact`, that of the exact faces.",
)
@click.option(
    "--residual",
    is_flag=True,
    help="Draw the pairs of a lattice's fits into a .png, in colours by what they lack to their "
    "targets.",
)
@click.option(
    "--mesh-tolerance",
    type=LENGTH,
    metavar="T",
    help="With --error: tolerance of the mesh, in model units. Default: 2e-4 of the mesh size.",
)
@click.option(
    "--hidden-points",
    is_flag=True,
    help="Draw the control points of an octree's empty cells too. The page has a tick box for "
    "them, which is then ticked from the start.",
)
@click.option("--fit-tolerance", type=LENGTH, help=texts.FIT_TOLERANCE)
@repair_option
@quiet_option
def view(
    file: Path,
    lattice: Path | None,
    output: Path,
    width: int,
    compare: bool,
    error: Literal["vertices", "uniform", "adaptive", "exact"] | None,
    residual: bool,
    mesh_tolerance: float | None,
    hidden_points: bool,
    fit_tolerance: float | None,
    repair: bool,
    quiet: bool,
) -> None:
    """Draw a mesh or CAD part before and after the deformation by LATTICE, or a CAD file alone.

    The .html page shows the model in 3D. It can hide lattice, edges, drags and octree cells, scale
    the deformation from rest to full, and shows the degree of each face and its distance from the
    deformed mesh. Control points of an octree's empty cells are hidden at first.
    """
    from ffdcli.files import require_place, write_whole

    kind = _kind(output)
    _reject_wrong_usage(file, lattice, kind, compare=compare, error=error, tolerance=mesh_tolerance)
    if residual and (lattice is None or kind != ".png" or compare or error is not None):
        raise click.UsageError(
            "--residual needs a lattice and a .png, and no --compare or --error."
        )
    for option, given in (
        ("--hidden-points", hidden_points),
        ("--fit-tolerance", fit_tolerance is not None),
    ):
        if given and (lattice is None or error is not None):
            raise click.UsageError(f"{option} needs a lattice and excludes --error.")
    require_place(output)
    lines: list[str] = []
    warnings: Sequence[str] = ()
    with show_stages(output.name, quiet=quiet) as progress:
        progress("read")
        if lattice is None:
            from ffdcli.view.cad_scene import scene_of_file

            content = _drawn(scene_of_file(file), kind, width, progress)
        else:
            from ffdcli.mesh import read_mesh
            from ffdcli.models import read_lattice, read_model

            if compare or error is not None:
                mesh = read_mesh(file, repair=repair)
                solved = read_lattice(lattice, mesh)
                warnings = (*mesh.notes, *solved.warnings)
            if compare:
                content, lines = _comparison(
                    mesh, solved, width, hidden_points, fit_tolerance, progress
                )
            elif residual:
                model = read_model(file, repair=repair)
                solved = read_lattice(lattice, model)
                content, warnings = _residual(model, solved, width, progress), solved.warnings
            elif error is not None:
                content = _error(mesh, solved, error, mesh_tolerance, width, progress)
            else:
                model = read_model(file, repair=repair)
                content, warnings = _deformation(
                    model,
                    read_lattice(lattice, model),
                    kind,
                    width,
                    hidden_points,
                    fit_tolerance,
                    progress,
                )
        write_whole(output, content)
    print_warnings(warnings, quiet=quiet)
    for line in lines:
        say(line)
    say(f"wrote {output}")


def _kind(output: Path) -> str:
    kind = output.suffix.lower()
    if kind in PICTURES:
        return kind
    raise FileError(
        f"cannot draw a picture of kind {output.suffix or 'without an extension'!r}",
        file=str(output),
        hint=f"use one of {', '.join(PICTURES)}",
    )


def _reject_wrong_usage(
    file: Path,
    lattice: Path | None,
    kind: str,
    *,
    compare: bool,
    error: str | None,
    tolerance: float | None,
) -> None:
    from ffdcli.brep.occ.formats import cad_format

    if cad_format(file) is None and lattice is None:
        raise click.UsageError("A mesh needs a lattice: name its file too.")
    for option, given in (("--compare", compare), ("--error", error is not None)):
        if given and (lattice is None or kind != ".png" or cad_format(file) is not None):
            raise click.UsageError(f"{option} needs a mesh, a lattice and a .png.")
    if compare and error is not None:
        raise click.UsageError("--compare and --error exclude each other.")
    if tolerance is not None and error is None:
        raise click.UsageError("--mesh-tolerance needs --error.")


def _deformation(
    model: Mesh | Part,
    lattice: Lattice,
    kind: str,
    width: int,
    hidden_points: bool,
    fit_tolerance: float | None,
    progress: Progress,
) -> tuple[bytes, tuple[str, ...]]:
    from ffdcli.models import as_mesh
    from ffdcli.pipeline import deform
    from ffdcli.result import Result
    from ffdcli.view.deformation_scene import scene_of
    from ffdcli.view.part_scene import scene_of_part

    result = deform(model, lattice, fit_tolerance=fit_tolerance, check=False, progress=progress)
    progress("triangles")
    if isinstance(result, Result):
        scene = scene_of(
            as_mesh(model),
            lattice,
            result,
            deviations=kind == ".html",
            hidden_points=hidden_points,
        )
    else:
        scene = scene_of_part(lattice, result, hidden_points=hidden_points)
    return _drawn(scene, kind, width, progress), result.warnings


def _drawn(scene: Scene, kind: str, width: int, progress: Progress) -> bytes:
    from ffdcli.view.before_after import before_and_after
    from ffdcli.view.draw import draw
    from ffdcli.view.page import page

    progress("draw")
    return page(scene).encode() if kind == ".html" else draw(before_and_after(scene), width=width)


def _comparison(
    mesh: Mesh,
    lattice: Lattice,
    width: int,
    hidden_points: bool,
    fit_tolerance: float | None,
    progress: Progress,
) -> tuple[bytes, list[str]]:
    """The eight panels as a .png, and the lines of the table."""
    from ffdcli.compare.table import compare_schemes
    from ffdcli.pipeline import prepare
    from ffdcli.plan import unit_of
    from ffdcli.view.draw import draw
    from ffdcli.view.eight_panels import eight_panels

    if len(lattice.members) > 1:
        raise LatticeError(
            "--compare needs a file of one lattice",
            file=lattice.source.name,
            hint="write one of its lattices into a file of its own",
        )
    plan = prepare(mesh, lattice, patches="paper", fit_tolerance=fit_tolerance, progress=progress)
    progress("table")
    # Earlier methods need polynomials too: all are compared on the fitted volume.
    rows = compare_schemes(mesh, lattice if plan.fitted is None else plan.fitted.lattice)
    progress("panels")
    panels = eight_panels(plan, lattice, hidden_points=hidden_points)
    lines = [f"{'scheme':<12}{'sub-polygons':>14}{'patches':>10}{'control points':>16}{'ms':>8}"]
    lines += [
        f"{row.scheme:<12}{row.sub_polygons:>14}{row.patches:>10}{row.control_points:>16}"
        f"{1000 * row.seconds:>8.0f}"
        for row in rows
    ]
    if plan.fitted is not None:
        bound = f"{plan.fitted.bound:.2g} {unit_of(mesh, lattice)}"
        lines.append(f"of the fitted volume, at most {bound} from the deformation")
    progress("draw")
    return draw(panels, width=width, columns=4), lines


def _error(
    mesh: Mesh,
    lattice: Lattice,
    mode: Literal["vertices", "uniform", "adaptive", "exact"],
    tolerance: float | None,
    width: int,
    progress: Progress,
) -> bytes:
    from ffdcli.view.draw import draw
    from ffdcli.view.error_map import error_panel

    progress("distances")
    panel = error_panel(mesh, lattice, mode, tolerance=tolerance)
    progress("draw")
    return draw([panel], width=width)


def _residual(model: Mesh | Part, lattice: Lattice, width: int, progress: Progress) -> bytes:
    from ffdcli.models import as_mesh
    from ffdcli.view.draw import draw
    from ffdcli.view.residual_map import residual_panel

    panel = residual_panel(as_mesh(model), lattice)
    progress("draw")
    return draw([panel], width=width)
