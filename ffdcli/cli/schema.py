"""Command `ffd schema`: print the JSON Schema of lattice files or jobs files."""

from __future__ import annotations

import click

from ffdcli.cli.options import json_option, print_json


@click.command()
@click.argument("kind", type=click.Choice(["lattice", "batch"]), default="lattice")
@json_option
def schema(kind: str, as_json: bool) -> None:
    """Print the JSON Schema of lattice files, or of the jobs files of `ffd batch`.

    Editors use it to complete and check files while you type. With the YAML language server, put
    `# yaml-language-server: $schema=lattice.schema.json` at the top of a file.
    """
    # All commands accept --json; here the output is JSON in any case.
    del as_json
    if kind == "batch":
        from ffdcli.batch import json_schema
    else:
        from ffdcli.lattice import json_schema
    print_json(json_schema())
