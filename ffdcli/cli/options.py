"""Options that several commands share, and functions that print JSON, errors and warnings."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from ffdcli import option_texts as texts
from ffdcli.errors import FfdError
from ffdcli.memory import LIMIT, parse_amount
from ffdcli.messages import json_text, printable, printable_lines

Command = TypeVar("Command", bound=Callable[..., Any])


class FiniteRange(click.FloatRange):
    """A range of numbers without `nan`, which every comparison lets pass, and infinity."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number; a usage error if it is not finite or out of range."""
        found = float(super().convert(value, param, ctx))
        if not math.isfinite(found):
            self.fail(f"{value} is not a finite number", param, ctx)
        return found

    def _describe_range(self) -> str:
        """The range as help pages show it; nothing where all finite numbers are allowed."""
        return "" if self.min is None and self.max is None else super()._describe_range()


# Click does not check files: the messages of the readers say what to do.
FILE = click.Path(path_type=Path)
LENGTH = FiniteRange(min=0, min_open=True)
ANGLE = FiniteRange(min=0, min_open=True, max=30)


def json_option(command: Command) -> Command:
    """Add `--json`: one JSON object on stdout, also on failure."""
    return click.option(
        "--json",
        "as_json",
        is_flag=True,
        help="Print the result or error as one JSON object.",
    )(command)


def quiet_option(command: Command) -> Command:
    """Add `--quiet`: no progress and no warnings."""
    return click.option("--quiet", is_flag=True, help="Print no progress and no warnings.")(command)


def memory_option(command: Command) -> Command:
    """Add `--memory`, which sets the variable FFD_MEMORY while the command runs."""
    return click.option(
        "--memory", metavar="LIMIT", expose_value=False, callback=_set_limit, help=texts.MEMORY
    )(command)


def _set_limit(context: click.Context, _option: click.Parameter, value: str | None) -> None:
    if value is None:
        return
    try:
        parse_amount(value)
    except FfdError as error:
        raise click.BadParameter(str(error)) from None
    before = os.environ.get(LIMIT)
    os.environ[LIMIT] = value

    def restore() -> None:
        os.environ.pop(LIMIT)
        if before is not None:
            os.environ[LIMIT] = before

    context.call_on_close(restore)


def repair_option(command: Command) -> Command:
    """Add `--repair`: repair the mesh after reading it."""
    return click.option(
        "--repair",
        is_flag=True,
        help=f"{texts.REPAIR} The changes are printed as warnings.",
    )(command)


def say(text: str, *, err: bool = False) -> None:
    """Print a line; characters of names in files cannot steer the terminal."""
    click.echo(printable(text), err=err)


def say_lines(text: str, *, err: bool = False, end: bool = True) -> None:
    """Print several lines likewise, and the ``end`` of the last."""
    click.echo(printable_lines(text), err=err, nl=end)


def print_json(value: Any) -> None:
    """Print the JSON object of a command with `--json`."""
    click.echo(json_text(value, indent=2))


def print_error_json(error: FfdError) -> None:
    """Print the JSON object of an error: kind, message, file, line, key, hint."""
    fields = ("kind", "message", "file", "line", "key", "hint")
    print_json({"error": {name: getattr(error, name) for name in fields}})


def print_warnings(warnings: Iterable[str], *, quiet: bool) -> None:
    """Print warnings to stderr."""
    for warning in () if quiet else warnings:
        say(f"warning: {warning}", err=True)
