"""`ffd view`: pictures of a deformation, or of a CAD file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ffdcli.cli.options import FILE, print_warnings, quiet_option
from ffdcli.cli.progress import show_stages
from ffdcli.errors import FileError

if TYPE_CHECKING:
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
@quiet_option
def view(file: Path, lattice: Path | None, output: Path, width: int, quiet: bool) -> None:
    """Draw MESH before and after LATTICE bends it, or a CAD file alone.

    A page turns with the mouse, shows and hides lattice, edges, drags, and octree cells, runs the
    deformation from rest to full, and says of each face what degree it has and how far it is from
    the deformed mesh.
    """
    from ffdcli.files import require_place, write_whole

    kind = _kind(output)
    require_place(output)
    with show_stages(output.name, quiet=quiet) as progress:
        scene, warnings = _scene(file, lattice, progress)
        progress("draw")
        write_whole(output, _page(scene) if kind == ".html" else _picture(scene, width))
    print_warnings(warnings, quiet=quiet)
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


def _scene(file: Path, lattice: Path | None, progress: Progress) -> tuple[Scene, tuple[str, ...]]:
    """What to draw, and what to warn of."""
    from ffdcli.brep.occ.formats import cad_format

    if cad_format(file) is not None:
        if lattice is not None:
            raise click.UsageError("A CAD file is drawn alone, without a lattice.")
        from ffdcli.view.cad import scene_of_file

        progress("read")
        return scene_of_file(file), ()
    if lattice is None:
        raise click.UsageError("A mesh is drawn with a lattice: name its file too.")
    from ffdcli.mesh import read_mesh
    from ffdcli.pipeline import deform, read_lattice
    from ffdcli.view.collect import scene_of

    progress("read")
    mesh = read_mesh(file)
    solved = read_lattice(lattice, mesh)
    result = deform(mesh, solved, check=False, progress=progress)
    progress("triangles")
    return scene_of(mesh, solved, result), result.warnings


def _page(scene: Scene) -> bytes:
    from ffdcli.view.page import page

    return page(scene).encode()


def _picture(scene: Scene, width: int) -> bytes:
    from ffdcli.view.draw import draw
    from ffdcli.view.panels import before_and_after

    return draw(before_and_after(scene), width=width)
