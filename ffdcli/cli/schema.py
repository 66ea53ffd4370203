"""`ffd schema`: JSON Schema of the lattice file."""

from __future__ import annotations

import click

from ffdcli.cli.options import json_option, print_json


@click.command()
@json_option
def schema(as_json: bool) -> None:
    """Print the JSON Schema of the lattice file, for editors.

    With the YAML language server, put `# yaml-language-server: $schema=lattice.schema.json` at
    the top of a lattice file to get completion and checks while typing.
    """
    from ffdcli.lattice.spec import json_schema

    # The schema is JSON with and without --json, which is here only because all commands have it.
    del as_json
    print_json(json_schema())
