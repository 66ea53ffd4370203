"""Command `ffd verify`: compare a CAD file with the deformation that it should contain."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli.cli.options import (
    FILE,
    LENGTH,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
    say,
)
from ffdcli.cli.progress import show_stages
from ffdcli.units import UNIT_NAMES

if TYPE_CHECKING:
    from ffdcli.verify import Verification


@click.command()
@click.argument("out", type=FILE)
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option(
    "--tolerance",
    type=LENGTH,
    help="Largest deviation allowed, in model units. Default: 1e-6 of the mesh size, 1e-5 for a "
    "lattice that is fitted and for CAD parts.",
)
@click.option(
    "--against",
    type=FILE,
    help="Report of the run that made OUT (`ffd deform --report`). The deviations that it states "
    "are allowed; use it for reduced and fitted results.",
)
@click.option(
    "--unit", type=click.Choice(UNIT_NAMES), help="Unit that OUT must state. Default: any."
)
@repair_option
@json_option
@quiet_option
def verify(
    out: Path,
    mesh: Path,
    lattice: Path,
    tolerance: float | None,
    against: Path | None,
    unit: str | None,
    repair: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Read the CAD file OUT and compare it with MESH deformed by LATTICE.

    Distances are measured both ways: from deformed points of the mesh to the faces of OUT, and
    from points of each face to the deformed mesh. Of a CAD part, faces, edges, vertices and curves
    in surface parameters are compared one by one, and counted. The exit status is 3 if OUT does not
    contain the deformation, and 4 if that is undecided: nothing wrong was found, but for some
    points the search ended without a proof.
    """
    from ffdcli.mesh import Mesh
    from ffdcli.models import read_lattice, read_model, verify_model

    if tolerance is not None and against is not None:
        raise click.UsageError("--tolerance and --against exclude each other.")
    with show_stages(out.name, quiet=quiet) as progress:
        progress("read")
        record = read_model(mesh, repair=repair)
        solved = read_lattice(lattice, record)
        stated = None if against is None else _read_report(against)
        verdict = verify_model(
            out,
            record,
            solved,
            tolerance=tolerance,
            stated=stated,
            source=against or "report",
            unit=unit,
        )
    print_warnings((*record.notes, *solved.warnings), quiet=quiet)
    if as_json:
        facts = {name: _finite(value) for name, value in vars(verdict).items()}
        print_json(facts)
    else:
        say(
            f"{out}: {_word(verdict)}: largest deviation "
            f"{verdict.max_deviation:.1e} of {verdict.tolerance:.1e} {verdict.unit} allowed, "
            f"{verdict.samples} samples on {verdict.faces} faces"
        )
    for reason in verdict.reasons:
        say(f"failed: {reason}", err=True)
    for sentence in verdict.undecided:
        say(f"undecided: {sentence}", err=True)
    if verdict.passed:
        return
    if stated is None and verdict.max_deviation > verdict.tolerance:
        fitted = solved.needs_fit or not isinstance(record, Mesh)
        option = "--fit-tolerance" if fitted else "--tolerance"
        say(
            f"hint: if OUT was made with {option}, give the report of that run with --against, or "
            f"that length with --tolerance",
            err=True,
        )
    click.get_current_context().exit(3 if verdict.reasons else 4)


def _word(verdict: Verification) -> str:
    if verdict.passed:
        return "passed"
    return "FAILED" if verdict.reasons else "UNDECIDED"


def _read_report(path: Path) -> Any:
    from ffdcli.errors import FileError
    from ffdcli.files import read_file

    try:
        # `null` is a file without fields, too.
        return json.loads(read_file(path)) or {}
    # JSON nested without end is a RecursionError.
    except (ValueError, RecursionError) as error:
        raise FileError(
            "this is not a report of ffd deform: it is not JSON",
            file=str(path),
            hint="write one with ffd deform --report FILE",
        ) from error


def _finite(value: Any) -> Any:
    """The value, or None if it is not finite: JSON has no infinity."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
