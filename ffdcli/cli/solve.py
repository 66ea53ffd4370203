"""Command `ffd solve`: apply the edits and drags of a lattice file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli.cli.options import (
    FILE,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
    say,
    say_lines,
)

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("lattice", type=FILE)
@click.option("-o", "--output", type=FILE, help="Lattice file to write. Default: stdout.")
@click.option(
    "--steps",
    is_flag=True,
    help="Replace each drag of several points by drags of one point each. The lattice file is "
    "written beside OUTPUT as NAME.steps.yaml, or to stdout.",
)
@repair_option
@json_option
@quiet_option
def solve(
    mesh: Path,
    lattice: Path,
    output: Path | None,
    steps: bool,
    repair: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Apply the edits and drags of LATTICE, fitted to MESH, a mesh or a CAD part.

    The result is a lattice file whose only edits are the control net and, with
    `volume: nurbs` or `tspline`, the weights. Numbers are written in full precision; large nets go
    to .npy files beside it.
    """
    from ffdcli import read_lattice
    from ffdcli.files import require_place
    from ffdcli.lattice import save_lattice, save_steps, solved_text, steps_text
    from ffdcli.models import read_model

    steps_file = None
    if output is not None:
        require_place(output)
        if steps:
            steps_file = output.with_name(f"{output.stem}.steps.yaml")
            require_place(steps_file)
    record = read_model(mesh, repair=repair)
    print_warnings(record.notes, quiet=quiet)
    solved = read_lattice(lattice, record)
    print_warnings(solved.warnings, quiet=quiet)
    if output is None and not as_json:
        say_lines(steps_text(solved) if steps else solved_text(solved), end=False)
        return
    files = [] if output is None else [str(file) for file in save_lattice(solved, output)]
    if steps_file is not None:
        files.append(str(save_steps(solved, steps_file)))
    if as_json:
        shapes = [list(each.shape) for each in solved.maps]
        result: dict[str, Any] = {
            "output": None if output is None else str(output),
            "files": files,
            "points": shapes if solved.listed else shapes[0],
            "warnings": list(solved.warnings),
        }
        if output is None:
            result["text"] = solved_text(solved)
        if steps:
            result["steps"] = _steps(solved)
        print_json(result)
    else:
        say(f"wrote {' and '.join(files)}")


def _steps(lattice: Lattice) -> list[dict[str, Any]]:
    """Drags of one point: the lattice and the edit they belong to, source, displacement, target."""
    from ffdcli.lattice import drag_steps

    return [
        {
            **({"lattice": step.lattice} if lattice.listed else {}),
            "edit": step.edit,
            "from": step.source.tolist(),
            "by": step.displacement.tolist(),
            "to": step.target.tolist(),
        }
        for step in drag_steps(lattice)
    ]
