"""The command group `ffd`: imports commands on use; turns errors into messages and exit status."""

from __future__ import annotations

import gc
import importlib
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from ffdcli import __version__
from ffdcli.cli.options import print_error_json, say, say_lines
from ffdcli.errors import FfdError, FileError, lacks_memory

# Name and help line of each command. They stand here, so that `ffd --help` imports no command.
_COMMANDS = {
    "deform": "Deform a mesh by a lattice and write the exact result as CAD, or a mesh.",
    "verify": "Compare a CAD file with the deformation that it should contain.",
    "fit": "Write the lattice file that fits a field of displacements, such as a result of FEA.",
    "new": "Write a commented lattice file for a mesh, to start from.",
    "info": "Print the contents of a mesh, lattice or CAD file.",
    "solve": "Apply the edits of a lattice file and write the resulting control points.",
    "edit": "Pull a model into shape in the browser, and write the lattice file.",
    "view": "Draw a deformation or a CAD file as a web page or a PNG picture.",
    "batch": "Run many deformations in parallel; an interrupted batch can be resumed.",
    "schema": "Print the JSON Schema of lattice files or jobs files, for editors.",
}

# New objects after which Python looks for cycles that nothing uses.
_OBJECTS = 200_000
_INTERRUPTED = 130
_WRONG_USAGE = 2


class LazyGroup(click.Group):
    """Click group that imports a command when it is called, and reports all errors."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order of the help page."""
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f"ffdcli.cli.{cmd_name}")
        command: click.Command = getattr(module, cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments name."""
        if args and args[0] not in _COMMANDS and not args[0].startswith("-"):
            known = ", ".join(_COMMANDS)
            raise click.UsageError(
                f"There is no command `{args[0]}`. The commands are {known}.", ctx
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = "ffd",
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command; always raises :class:`SystemExit` with the exit status.

        0: done; 1: bad input or failure; 2: wrong usage; 3: verification failed; 130: interrupted.
        """
        arguments = list(sys.argv[1:] if args is None else args)
        # OpenCascade's module alone makes 200,000 objects that are never freed.
        gc.set_threshold(_OBJECTS)
        before_files = arguments[: arguments.index("--")] if "--" in arguments else arguments
        as_json = "--json" in before_files
        if threading.current_thread() is threading.main_thread():
            # SystemExit lets the context managers remove unfinished files.
            signal.signal(signal.SIGTERM, _exit_on_signal)
        try:
            status = super().main(
                arguments,
                prog_name,
                complete_var,
                standalone_mode=False,
                windows_expand_args=windows_expand_args,
                **extra,
            )
        except Exception as error:
            sys.exit(_report(error, as_json=as_json))
        sys.exit(status if isinstance(status, int) else 0)


def _exit_on_signal(signum: int, _frame: object) -> NoReturn:
    sys.exit(128 + signum)


def _report(error: Exception, *, as_json: bool) -> int:
    """Print an error to stderr, and with `--json` to stdout too; returns the exit status."""
    if isinstance(error, click.Abort):
        say("interrupted", err=True)
        return _with_status("interrupted", "interrupted", _INTERRUPTED, as_json=as_json)
    if isinstance(error, click.ClickException):
        shown = io.StringIO()
        error.show(shown)
        say_lines(shown.getvalue(), err=True, end=False)
        return _with_status("usage", error.format_message(), _WRONG_USAGE, as_json=as_json)
    if isinstance(error, FfdError):
        say(f"error: {error}", err=True)
        if as_json:
            print_error_json(error)
        return 1
    if isinstance(error, OSError):
        name = None if error.filename is None else str(error.filename)
        reason = error.strerror or str(error) or "the file cannot be used"
        return _report(FileError(reason.lower(), file=name), as_json=as_json)
    if lacks_memory(error):
        hint = "use a smaller mesh or lattice"
        return _report(FfdError("there is not enough memory", hint=hint), as_json=as_json)
    if "FFD_TRACEBACK" in os.environ:
        traceback.print_exception(error)
    detail = " ".join(str(error).split()) or "no message"
    message = f"internal error, please report it: {type(error).__name__}: {detail}"
    say(f"error: {message} (set FFD_TRACEBACK=1 to print the traceback)", err=True)
    return _with_status("internal", message, 1, as_json=as_json)


def _with_status(kind: str, message: str, status: int, *, as_json: bool) -> int:
    """Print the error object if `--json` is given; returns the status."""
    if as_json:
        error = FfdError(message)
        error.kind = kind
        print_error_json(error)
    return status


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="ffd")
def main() -> None:
    """Bend a polygon mesh with a lattice of control points; write the exact result as CAD.

    \b
    ffd new part.obj -o lattice.yaml        write a lattice, then edit it
    ffd deform part.obj lattice.yaml -o part.step
    ffd verify part.step part.obj lattice.yaml
    """
