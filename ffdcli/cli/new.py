"""Command `ffd new`: write a commented lattice file for a mesh."""

from __future__ import annotations

from pathlib import Path

import click

from ffdcli.cli.options import (
    FILE,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    say,
    say_lines,
)
from ffdcli.errors import FileError
from ffdcli.messages import printable


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-o", "--output", type=FILE, help="Lattice file to write. Default: stdout.")
@click.option(
    "--volume",
    type=click.Choice(["bspline", "tspline", "hierarchical"]),
    default="bspline",
    help="Kind of volume. `tspline` and `hierarchical` have more control points near the mesh. "
    "Default: bspline.",
)
@click.option(
    "--octree-depth",
    type=click.IntRange(1, 9),
    help="For tspline and hierarchical: how often the cells that contain parts of the mesh are "
    "halved. Default: 4.",
)
@click.option("--force", is_flag=True, help="Overwrite OUTPUT if it exists.")
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
    """Write a commented lattice file for MESH, a mesh or a CAD part, to start from.

    The file has no effect yet: its edits are examples to uncomment.
    """
    from ffdcli.files import require_place, write_whole
    from ffdcli.lattice import OctreeStart, parse_lattice, starter_text
    from ffdcli.lattice.file.source import parse_yaml
    from ffdcli.models import as_mesh, read_model, settle_lattice

    if octree_depth is not None and volume == "bspline":
        raise click.UsageError("--octree-depth needs --volume tspline or --volume hierarchical.")
    if output is not None:
        require_place(output)
        if output.exists() and not force:
            hint = "choose another name, or overwrite it with --force"
            raise FileError("this file exists already", file=str(output), hint=hint)
    record = read_model(mesh)
    print_warnings(record.notes, quiet=quiet)
    octree = None
    if volume != "bspline":
        vertices = as_mesh(record).vertices
        highest = vertices[vertices[:, 2].argmax()]
        octree = OctreeStart(volume, octree_depth or 4, highest)
    text = starter_text(
        mesh=printable(str(mesh)),
        bounds=record.bounds,
        delta=record.delta,
        unit=record.unit,
        lattice=printable(str(output or "lattice.yaml")),
        octree=octree,
    )
    if octree is not None:
        # The number of its cells depends on the mesh.
        settle_lattice(parse_lattice(*parse_yaml(text, str(output or "lattice.yaml"))), record)
    if output is not None:
        write_whole(output, text.encode())
    if as_json:
        print_json({"output": None if output is None else str(output), "text": text})
    elif output is None:
        say_lines(text, end=False)
    else:
        say(f"wrote {output}")
