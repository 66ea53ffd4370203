"""`ffd solve`: a lattice's edits worked out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ffdcli.cli.options import FILE, json_option, print_json, print_warnings, quiet_option


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option("-o", "--output", type=FILE, help="The lattice file to write; default: stdout.")
@json_option
@quiet_option
def solve(mesh: Path, lattice: Path, output: Path | None, as_json: bool, quiet: bool) -> None:
    """Apply the edits of LATTICE for MESH.

    The result is a lattice file whose only edit is the explicit control net, to the last bit. A
    large net goes into a .npy file beside it.
    """
    from ffdcli import read_lattice, read_mesh
    from ffdcli.files import require_place
    from ffdcli.lattice import save_lattice, solved_text

    if output is not None:
        require_place(output)
    record = read_mesh(mesh)
    print_warnings(record.notes, quiet=quiet)
    solved = read_lattice(lattice, record)
    print_warnings(solved.warnings, quiet=quiet)
    if output is None and not as_json:
        click.echo(solved_text(solved), nl=False)
        return
    files = [] if output is None else [str(file) for file in save_lattice(solved, output)]
    if as_json:
        result: dict[str, Any] = {
            "output": None if output is None else str(output),
            "files": files,
            "points": list(solved.volume.shape),
            "warnings": list(solved.warnings),
        }
        if output is None:
            result["text"] = solved_text(solved)
        print_json(result)
    else:
        click.echo(f"wrote {' and '.join(files)}")
