"""Command `ffd fit`: write a lattice file that fits a field of displacements, or a scan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ffdcli.cli.fit_lines import fit_lines
from ffdcli.cli.folding_facts import folding_facts
from ffdcli.cli.folding_text import folding_text
from ffdcli.cli.options import (
    FILE,
    LENGTH,
    FiniteRange,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
    say,
    say_lines,
)
from ffdcli.cli.progress import show_stages
from ffdcli.units import UNIT_NAMES


@click.command()
@click.argument("mesh", type=FILE)
@click.argument("field_file", metavar="FIELD", type=FILE)
@click.option("-o", "--output", type=FILE, help="Lattice file to write. Default: stdout.")
@click.option("--field", help="Name of the displacement field in a mesh file.")
@click.option(
    "--targets",
    type=FILE,
    help="For a mesh file without a result: the same mesh, deformed; or a table node,dx,dy,dz.",
)
@click.option(
    "--unit", type=click.Choice(UNIT_NAMES), help="Length unit of FIELD. Default: that of MESH."
)
@click.option(
    "--reach",
    type=LENGTH,
    help="For a scan: largest distance from the model at which a point counts. Default: a tenth of "
    "the diagonal of the box.",
)
@click.option(
    "--scale", type=FiniteRange(), help="Factor of all displacements; -1 compensates. Default: 1."
)
@click.option(
    "--tolerance",
    type=LENGTH,
    help="Distance from their targets within which images are to be. Default: 1e-4 of the diagonal "
    "of the box.",
)
@click.option(
    "--smooth",
    type=FiniteRange(min=0),
    help="Weight of the bending energy. Default: by the noise of the data.",
)
@click.option(
    "--robust/--no-robust",
    default=True,
    help="Whether pairs that disagree with all their neighbours count less. Default: they do.",
)
@click.option("--hold", multiple=True, metavar="GROUP", help="Group of the mesh that stays.")
@click.option(
    "--volume",
    type=click.Choice(["hierarchical", "bspline", "nurbs"]),
    default="hierarchical",
    help="Kind of volume. `hierarchical` gets more control points where the field needs them. "
    "Default: hierarchical.",
)
@click.option("--degree", type=click.IntRange(1, 5), help="Degree along all axes. Default: 3.")
@click.option(
    "--points",
    type=int,
    nargs=3,
    help="For bspline and nurbs: numbers of control points along x, y and z.",
)
@click.option(
    "--octree-depth",
    type=click.IntRange(1, 9),
    help="For hierarchical: how often cells near the mesh are halved. Default: where the field "
    "needs it.",
)
@click.option("--max-depth", type=click.IntRange(1, 9), help="Most times that a cell is halved.")
@click.option("--max-points", type=click.IntRange(min=1), help="Most control points.")
@click.option(
    "--solved", is_flag=True, help="Write the fitted control points, in place of the fit itself."
)
@click.option("--force", is_flag=True, help="Overwrite OUTPUT if it exists.")
@repair_option
@json_option
@quiet_option
def fit(
    mesh: Path,
    field_file: Path,
    output: Path | None,
    targets: Path | None,
    hold: tuple[str, ...],
    solved: bool,
    force: bool,
    repair: bool,
    as_json: bool,
    quiet: bool,
    **how: Any,
) -> None:
    """Write the lattice file that moves the points of FIELD as it says, for MESH.

    MESH is a mesh or a CAD part. FIELD is a table (.csv), arrays (.npz), or a mesh file with a
    result of finite elements (.vtu, .vtk, .xdmf). What the fit reached is printed. Then `ffd
    deform` with the lattice file writes the deformed solid.

    FIELD may also be a scan without displacements: a mesh (.ply, .stl, .obj), or points (.ply,
    .xyz, .csv, .npz). MESH is then bent onto it, and the places of MESH that were found for the
    points are written beside the lattice file.
    """
    from ffdcli.errors import FileError
    from ffdcli.field_fit import fit_field, pairs_file
    from ffdcli.files import require_file, require_place, write_whole
    from ffdcli.scan.read import is_scan

    _reject_wrong_usage(how)
    require_file(field_file)
    if output is not None:
        require_place(output)
        written = [output, pairs_file(output)] if is_scan(field_file) and not solved else [output]
        for file in written:
            if file.exists() and not force:
                hint = "choose another name, or overwrite it with --force"
                raise FileError("this file exists already", file=str(file), hint=hint)
    with show_stages((output or mesh).name, quiet=quiet) as progress:
        progress("read")
        from ffdcli.lattice import save_lattice, solved_text
        from ffdcli.lattice.export.fit_text import FitChoice
        from ffdcli.lattice.fit.report import facts_of_fits
        from ffdcli.models import as_mesh, read_model

        model = read_model(mesh, repair=repair)
        print_warnings(model.notes, quiet=quiet)
        choice = FitChoice(
            **{key: value for key, value in how.items() if value is not None},
            targets=None if targets is None else str(targets),
            hold=hold,
        )
        progress("fit")
        place = output or Path("lattice.yaml")
        found = fit_field(model, field_file, choice, output=place, name=str(mesh))
        print_warnings(found.lattice.warnings, quiet=quiet)
        progress("look for folds")
        facts: dict[str, Any] = facts_of_fits(found.lattice.fits)
        facts["jacobian"] = folding_facts(as_mesh(model), found.lattice, None)
    files, text = [], solved_text(found.lattice) if solved and output is None else found.text
    if output is not None and solved:
        files = [str(file) for file in save_lattice(found.lattice, output)]
    elif output is not None and found.pairs is not None:
        write_whole(found.pairs.file, found.pairs.content)
        write_whole(output, found.pairs.text.encode())
        files = [str(output), str(found.pairs.file)]
    elif output is not None:
        write_whole(output, text.encode())
        files = [str(output)]
    if as_json:
        shown = {"text": text} if output is None else {}
        warnings = list(found.lattice.warnings)
        name = None if output is None else str(output)
        print_json({"output": name, "files": files, **facts, "warnings": warnings, **shown})
        return
    if output is None:
        say_lines(text, end=False)
    for line in () if quiet and output is None else _lines(facts):
        say(line, err=output is None)
    if output is not None:
        say(f"wrote {' and '.join(files)}")


def _lines(facts: dict[str, Any]) -> list[str]:
    lines = [line for each in facts["fits"] for line in fit_lines(each)]
    lines.append(f"folding:  {folding_text(facts['jacobian'])}")
    return lines


def _reject_wrong_usage(how: dict[str, Any]) -> None:
    rows = how["volume"] != "hierarchical"
    octree = ("octree_depth", "max_depth", "max_points")
    for name in octree if rows else ("points",):
        if how[name] is not None:
            option, need = f"--{name.replace('_', '-')}", "bspline or nurbs"
            raise click.UsageError(f"{option} needs --volume {'hierarchical' if rows else need}.")
    if how["octree_depth"] is not None and not (how["max_depth"] is how["max_points"] is None):
        raise click.UsageError("--max-depth and --max-points are limits of cells halved as needed.")
    if how["scale"] == 0:
        raise click.UsageError("--scale 0 moves nothing.")
