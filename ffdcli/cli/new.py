"""`ffd new`: a commented starter lattice fitted to a mesh."""

from __future__ import annotations

from pathlib import Path

import click

from ffdcli.cli.options import FILE, json_option, print_json, print_warnings, quiet_option
from ffdcli.errors import FileError


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-o", "--output", type=FILE, help="The lattice file to write; default: stdout.")
@click.option(
    "--volume",
    type=click.Choice(["bspline", "tspline", "hierarchical"]),
    default="bspline",
    show_default=True,
    help="Kind of volume; the last two are finer where the mesh is.",
)
@click.option(
    "--octree-depth",
    type=click.IntRange(1, 9),
    help="How often cells that hold part of the mesh are halved, for the last two. [default: 4]",
)
@click.option("--force", is_flag=True, help="Overwrite the lattice file if it exists.")
@json_option
@quiet_option
def new(
    mesh: Path,
    output: Path | None,
    volume: str,
    octree_depth: int | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write a commented starter lattice fitted to MESH.

    As written it leaves the mesh as it is; the edits in it are examples to uncomment.
    """
    from ffdcli import read_mesh
    from ffdcli.files import require_place, write_whole
    from ffdcli.lattice import OctreeStart, starter_text

    if octree_depth is not None and volume == "bspline":
        raise click.UsageError("--octree-depth goes with --volume tspline or hierarchical.")
    if output is not None:
        require_place(output)
        if output.exists() and not force:
            hint = "choose another name, or say --force to overwrite it"
            raise FileError("this file exists already", file=str(output), hint=hint)
    record = read_mesh(mesh)
    print_warnings(record.notes, quiet=quiet)
    octree = None
    if volume != "bspline":
        highest = record.vertices[record.vertices[:, 2].argmax()]
        octree = OctreeStart(volume, octree_depth or 4, highest)
    text = starter_text(
        mesh=str(mesh),
        bounds=record.bounds,
        delta=record.delta,
        unit=record.unit,
        lattice=str(output or "lattice.yaml"),
        octree=octree,
    )
    if output is not None:
        write_whole(output, text.encode())
    if as_json:
        print_json({"output": None if output is None else str(output), "text": text})
    elif output is None:
        click.echo(text, nl=False)
    else:
        click.echo(f"wrote {output}")
