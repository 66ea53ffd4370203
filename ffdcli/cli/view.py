"""`ffd view`: pictures of a deformation, or of a CAD file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from ffdcli.cli.options import FILE, print_warnings, quiet_option, repair_option
from ffdcli.cli.progress import show_stages
from ffdcli.errors import FileError, LatticeError
from ffdcli.formats import SUBDIVISIONS

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
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
    help="The picture: .html, a page that needs nothing else, or .png.",
)
@click.option("--width", type=click.IntRange(200, 8000), default=1400, show_default=True,
              help="Width of a .png in pixels.")  # fmt: skip
@click.option(
    "--compare",
    is_flag=True,
    help="A .png of eight panels: the mesh, subdivision, previous exact methods, and this one "
    "(Feng 2002, Figs. 7-13); prints what each method needs, as Table 2 there.",
)
@click.option(
    "--error",
    type=click.Choice([*SUBDIVISIONS, "exact"]),
    help="A .png of how far a mesh is from the exact surface: one made by this --mesh-mode of "
    "ffd deform, or of the exact faces.",
)
@click.option("--mesh-tolerance", type=float, metavar="T", help="With --error: that of the mesh.")
@repair_option
@quiet_option
def view(
    file: Path,
    lattice: Path | None,
    output: Path,
    width: int,
    compare: bool,
    error: Literal["vertices", "uniform", "adaptive", "exact"] | None,
    mesh_tolerance: float | None,
    repair: bool,
    quiet: bool,
) -> None:
    """Draw MESH before and after LATTICE bends it, or a CAD file alone.

    A page turns with the mouse, shows and hides lattice, edges, drags, and octree cells, runs the
    deformation from rest to full, and says of each face what degree it has and how far it is from
    the deformed mesh.
    """
    from ffdcli.files import require_place, write_whole

    kind = _kind(output)
    _require_fitting(file, lattice, kind, compare=compare, error=error, tolerance=mesh_tolerance)
    require_place(output)
    lines: list[str] = []
    warnings: Sequence[str] = ()
    with show_stages(output.name, quiet=quiet) as progress:
        progress("read")
        if lattice is None:
            from ffdcli.view.cad import scene_of_file

            content = _drawn(scene_of_file(file), kind, width, progress)
        else:
            from ffdcli.mesh import read_mesh
            from ffdcli.pipeline import read_lattice

            mesh = read_mesh(file, repair=repair)
            solved = read_lattice(lattice, mesh)
            warnings = (*mesh.notes, *solved.warnings)
            if compare:
                content, lines = _comparison(mesh, solved, width, progress)
            elif error is not None:
                content = _error(mesh, solved, error, mesh_tolerance, width, progress)
            else:
                content, warnings = _deformation(mesh, solved, kind, width, progress)
        write_whole(output, content)
    print_warnings(warnings, quiet=quiet)
    for line in lines:
        click.echo(line)
    click.echo(f"wrote {output}")


def _kind(output: Path) -> str:
    kind = output.suffix.lower()
    if kind in PICTURES:
        return kind
    raise FileError(
        f"cannot draw a picture of kind {output.suffix or 'without an extension'!r}",
        file=str(output),
        hint=f"use one of {', '.join(PICTURES)}",
    )


def _require_fitting(
    file: Path,
    lattice: Path | None,
    kind: str,
    *,
    compare: bool,
    error: str | None,
    tolerance: float | None,
) -> None:
    from ffdcli.brep.occ.formats import cad_format

    if cad_format(file) is not None and lattice is not None:
        raise click.UsageError("A CAD file is drawn alone, without a lattice.")
    if cad_format(file) is None and lattice is None:
        raise click.UsageError("A mesh is drawn with a lattice: name its file too.")
    for option, given in (("--compare", compare), ("--error", error is not None)):
        if given and (lattice is None or kind != ".png"):
            raise click.UsageError(f"{option} draws a mesh and its lattice into a .png.")
    if compare and error is not None:
        raise click.UsageError("--compare and --error are pictures of their own.")
    if tolerance is not None and error is None:
        raise click.UsageError("--mesh-tolerance goes with --error.")


def _deformation(
    mesh: Mesh, lattice: Lattice, kind: str, width: int, progress: Progress
) -> tuple[bytes, tuple[str, ...]]:
    from ffdcli.pipeline import deform
    from ffdcli.view.collect import scene_of

    result = deform(mesh, lattice, check=False, progress=progress)
    progress("triangles")
    return _drawn(
        scene_of(mesh, lattice, result, deviations=kind == ".html"), kind, width, progress
    ), result.warnings


def _drawn(scene: Scene, kind: str, width: int, progress: Progress) -> bytes:
    from ffdcli.view.draw import draw
    from ffdcli.view.page import page
    from ffdcli.view.panels import before_and_after

    progress("draw")
    return page(scene).encode() if kind == ".html" else draw(before_and_after(scene), width=width)


def _comparison(
    mesh: Mesh, lattice: Lattice, width: int, progress: Progress
) -> tuple[bytes, list[str]]:
    """The eight panels, and the paper's table."""
    from ffdcli.compare.table import compare_schemes
    from ffdcli.view.comparison import eight_panels
    from ffdcli.view.draw import draw

    if len(lattice.members) > 1 or lattice.member.spec.octree is not None:
        raise LatticeError(
            "--compare takes a file of one lattice, and none on an octree",
            file=lattice.source.name,
            hint="give it a single lattice of volume bspline or nurbs",
        )
    progress("table")
    rows = compare_schemes(mesh, lattice)
    progress("panels")
    panels = eight_panels(mesh, lattice)
    lines = [f"{'scheme':<12}{'sub-polygons':>14}{'patches':>10}{'control points':>16}{'ms':>8}"]
    lines += [
        f"{row.scheme:<12}{row.sub_polygons:>14}{row.patches:>10}{row.control_points:>16}"
        f"{1000 * row.seconds:>8.0f}"
        for row in rows
    ]
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
    from ffdcli.view.deviation import error_panel
    from ffdcli.view.draw import draw

    progress("distances")
    panel = error_panel(mesh, lattice, mode, tolerance=tolerance)
    progress("draw")
    return draw([panel], width=width)
