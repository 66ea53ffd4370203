"""Options that commands share, and the ways they print."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from ffdcli.errors import FfdError

Command = TypeVar("Command", bound=Callable[..., Any])

# Files are checked by the readers, whose messages say what to do; click's would not.
FILE = click.Path(path_type=Path)


def json_option(command: Command) -> Command:
    """`--json`: one JSON object on stdout, also on failure."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object, also on failure."
    )(command)


def quiet_option(command: Command) -> Command:
    """`--quiet`: no progress and no warnings."""
    return click.option("--quiet", is_flag=True, help="No progress and no warnings on stderr.")(
        command
    )


def repair_option(command: Command) -> Command:
    """`--repair`: mend the mesh as it is read."""
    return click.option(
        "--repair",
        is_flag=True,
        help="Mend the mesh where that does not move its surface, and say what was done.",
    )(command)


def print_json(value: Any) -> None:
    """The one JSON object of a command with `--json`."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def print_error_json(error: FfdError) -> None:
    """The contract's error object."""
    fields = ("kind", "message", "file", "line", "key", "hint")
    print_json({"error": {name: getattr(error, name) for name in fields}})


def print_warnings(warnings: Iterable[str], *, quiet: bool) -> None:
    """Warnings, on stderr."""
    for warning in () if quiet else warnings:
        click.echo(f"warning: {warning}", err=True)
