"""`ffd schema`: JSON Schema of the lattice file or the jobs file."""

from __future__ import annotations

import click

from ffdcli.cli.options import json_option, print_json


@click.command()
@click.argument("kind", type=click.Choice(["lattice", "batch"]), default="lattice")
@json_option
def schema(kind: str, as_json: bool) -> None:
    """Print the JSON Schema of the lattice file, or of the jobs file of `ffd batch`, for editors.

    With the YAML language server, put `# yaml-language-server: $schema=lattice.schema.json` at
    the top of a file to get completion and checks while typing.
    """
    # The schema is JSON with and without --json, which is here only because all commands have it.
    del as_json
    if kind == "batch":
        from ffdcli.batch import json_schema
    else:
        from ffdcli.lattice import json_schema
    print_json(json_schema())
