"""`ffd new`: a commented starter lattice fitted to a mesh."""

from __future__ import annotations

from pathlib import Path

import click

from ffdcli.cli.options import FILE, json_option, print_json, print_warnings, quiet_option
from ffdcli.errors import FileError


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-o", "--output", type=FILE, help="The lattice file to write; default: stdout.")
@click.option("--force", is_flag=True, help="Overwrite the lattice file if it exists.")
@json_option
@quiet_option
def new(mesh: Path, output: Path | None, force: bool, as_json: bool, quiet: bool) -> None:
    """Write a commented starter lattice fitted to MESH.

    As written it leaves the mesh as it is; the edits in it are examples to uncomment.
    """
    from ffdcli import read_mesh
    from ffdcli.files import require_place, write_whole
    from ffdcli.lattice import starter_text

    if output is not None:
        require_place(output)
        if output.exists() and not force:
            hint = "choose another name, or say --force to overwrite it"
            raise FileError("this file exists already", file=str(output), hint=hint)
    record = read_mesh(mesh)
    print_warnings(record.notes, quiet=quiet)
    text = starter_text(
        mesh=str(mesh),
        bounds=record.bounds,
        delta=record.delta,
        unit=record.unit,
        lattice=str(output or "lattice.yaml"),
    )
    if output is not None:
        write_whole(output, text.encode())
    if as_json:
        print_json({"output": None if output is None else str(output), "text": text})
    elif output is None:
        click.echo(text, nl=False)
    else:
        click.echo(f"wrote {output}")
