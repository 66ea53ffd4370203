"""Command `ffd edit`: reshape a model in the browser."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from ffdcli.cli.deform_summary import summary
from ffdcli.cli.options import FILE, say
from ffdcli.errors import FfdError


@click.command()
@click.argument("model", type=FILE, metavar="MESH_OR_CAD")
@click.argument("lattice", type=FILE, required=False, metavar="[LATTICE.yaml]")
@click.option(
    "-o",
    "--output",
    type=FILE,
    help="CAD file that the page writes. Default: the lattice file's name with .step.",
)
@click.option(
    "--volume",
    type=click.Choice(["bspline", "nurbs", "tspline", "hierarchical"]),
    default="bspline",
    help="Kind of volume of a new lattice file. `nurbs` and `tspline` have weights. "
    "Default: bspline.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of the page on this machine. Default: one that is free.",
)
@click.option("--no-open", is_flag=True, help="Print the address of the page, and open no browser.")
def edit(
    model: Path,
    lattice: Path | None,
    output: Path | None,
    volume: str,
    port: int,
    no_open: bool,
) -> None:
    """Pull a mesh or CAD part into shape in the browser; writes the lattice file.

    Without LATTICE.yaml its name is that of the model; if there is no such file, the first Save
    makes it. The page is served on this machine alone, at an address with a secret. It ends with
    Ctrl-C, or when it is closed. Needs `pip install 'ffdcli[edit]'`.
    """
    if find_spec("viser") is None:
        raise FfdError("`ffd edit` needs the package viser", hint="pip install 'ffdcli[edit]'")
    from ffdcli.editor import Session

    say(f"reading {model}")
    with Session.open(model, lattice, output=output, volume=volume) as session:
        from ffdcli.editor.page.app import run

        for notice in session.notices:
            say(notice)

        def opened(address: str) -> None:
            say(f"editing {session.path}")
            say(f"page: {address}")
            say("Ctrl-C ends it, and so does closing the page.")
            if not no_open:
                click.launch(address)

        try:
            run(session, port, opened, _lines)
        except KeyboardInterrupt:
            say("")
        else:
            say("the page was closed")
        made = any(session.edits(number) for number in range(session.count))
        if session.unsaved and (made or session.path.exists()):
            say(f"edits that were not saved are kept; `ffd edit {model} {session.path}` shows them")
        elif made:
            say("all edits are saved")


def _lines(report: dict[str, Any]) -> str:
    """What the commands print of a report of `ffd deform` or `ffd verify`."""
    if "passed" not in report:
        return summary(report)
    word = "passed" if report["passed"] else "FAILED" if report["reasons"] else "UNDECIDED"
    line = (
        f"{word}: largest deviation {report['max_deviation']:.1e} of {report['tolerance']:.1e} "
        f"{report['unit']} allowed, {report['samples']} samples on {report['faces']} faces"
    )
    failed = [f"failed: {reason}" for reason in report["reasons"]]
    return "\n".join([line, *failed, *(f"undecided: {each}" for each in report["undecided"])])
