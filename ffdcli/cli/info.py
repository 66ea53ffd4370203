"""Command `ffd info`: print the contents of a mesh, lattice or CAD file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli import option_texts as texts
from ffdcli.cli.cad_facts import cad_facts
from ffdcli.cli.folding_facts import folding_facts
from ffdcli.cli.folding_text import folding_text, scale_text
from ffdcli.cli.options import (
    FILE,
    LENGTH,
    json_option,
    print_json,
    print_warnings,
    quiet_option,
    repair_option,
    say,
    say_lines,
)
from ffdcli.cli.progress import show_stages

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice, LatticeFile
    from ffdcli.lattice.file.definition import Definition
    from ffdcli.mesh import Mesh
    from ffdcli.stopwatch import Progress

Facts = dict[str, Any]


@click.command()
@click.argument("file", type=FILE)
@click.option("--mesh", type=FILE, help="For a lattice: the mesh that it is fitted to.")
@repair_option
@click.option(
    "--cells",
    type=FILE,
    help="For a lattice on an octree, with --mesh: write its cells to this .csv file, for "
    "`octree: {cells: FILE}`.",
)
@click.option(
    "--injective-scale",
    is_flag=True,
    help="For a lattice, with --mesh: print the largest factor by which the edits can be scaled "
    "without folding the mesh.",
)
@click.option("--fit-tolerance", type=LENGTH, help=texts.FIT_TOLERANCE)
@json_option
@quiet_option
def info(
    file: Path,
    mesh: Path | None,
    repair: bool,
    cells: Path | None,
    injective_scale: bool,
    fit_tolerance: float | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print the contents of FILE: a mesh, a lattice (.yaml) or a CAD file (.step, .iges, .brep)."""
    kind = _kind(file)
    if mesh is not None and kind != "lattice":
        raise click.UsageError("--mesh needs a lattice file.")
    if repair and kind != "mesh" and mesh is None:
        raise click.UsageError("--repair needs a mesh.")
    if injective_scale and mesh is None:
        raise click.UsageError("--injective-scale needs --mesh.")
    if cells is not None and mesh is None:
        raise click.UsageError("--cells needs --mesh.")
    if fit_tolerance is not None and mesh is None:
        raise click.UsageError("--fit-tolerance needs --mesh.")
    if kind == "lattice":
        with show_stages(file.name, quiet=quiet) as progress:
            facts = _lattice_facts(
                file, mesh, repair, cells, injective_scale, fit_tolerance, progress
            )
    else:
        facts = cad_facts(file) if kind == "cad" else _mesh_facts(file, repair)
    if as_json:
        print_json({"file": str(file), "kind": kind, **facts})
        return
    print_warnings(facts.pop("warnings"), quiet=quiet)
    members = facts.pop("lattices", [])
    if "jacobian" in facts:
        facts["folding"] = folding_text(facts.pop("jacobian"))
    if "injective_scale" in facts:
        facts["injective_scale"] = scale_text(facts["injective_scale"])
    _print(facts)
    for number, member in enumerate(members):
        say_lines(f"\nlattices[{number}]")
        _print(member)


def _print(facts: Facts) -> None:
    width = max(map(len, facts)) + 2
    for name, value in facts.items():
        say(f"{name.replace('_', ' ') + ':':<{width}}{_text(value)}")


def _kind(file: Path) -> str:
    from ffdcli.brep.occ.formats import cad_format

    if file.suffix.lower() in (".yaml", ".yml"):
        return "lattice"
    return "mesh" if cad_format(file) is None else "cad"


def _text(value: Any, between: str = ", ") -> str:
    """A fact in words; what lies deeper inside it is divided by spaces only."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value == [] or value == ():
        return "none"
    if isinstance(value, dict):
        parts = [f"{name} {_text(each, ' ')}" for name, each in value.items() if each is not None]
        return between.join(part.replace("_", " ") for part in parts)
    if isinstance(value, (list, tuple)):
        apart = "; " if isinstance(value[0], (dict, list, tuple)) else " "
        apart = ", " if isinstance(value[0], str) else apart
        return apart.join(_text(each, " ") for each in value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _mesh_facts(file: Path, repair: bool) -> Facts:
    from ffdcli import read_mesh
    from ffdcli.mesh import Finding, describe_faults, describe_remarks, inspect, usability

    mesh = read_mesh(file, repair=repair)
    found = inspect(mesh)
    counts = {name: each.count for name, each in vars(found).items() if isinstance(each, Finding)}
    usable = usability(mesh, found)
    faults = [
        what if usable == "with --repair" else f"{what}: {hint}"
        for what, hint in describe_faults(found)
    ]
    return {
        "vertices": len(mesh.vertices),
        "polygons": mesh.polygon_count,
        "bodies": found.bodies,
        "closed": found.closed,
        "usable": usable,
        **counts,
        "volume": float(found.volumes.sum()) if found.closed else None,
        "min": mesh.bounds[0].tolist(),
        "max": mesh.bounds[1].tolist(),
        "size": mesh.size,
        "resolution": mesh.resolution,
        "unit": mesh.unit,
        "warnings": [*mesh.notes, *faults, *describe_remarks(mesh, found)],
    }


def _lattice_facts(
    file: Path,
    mesh: Path | None,
    repair: bool,
    cells: Path | None,
    injective_scale: bool,
    fit_tolerance: float | None,
    progress: Progress,
) -> Facts:
    from ffdcli.models import as_mesh, read_lattice, read_model

    if mesh is None:
        lattice_file = read_lattice(file)
        parts = [_definition_facts(definition) for definition in lattice_file.definitions]
        return {**_file_facts(lattice_file, parts), "warnings": []}
    model = read_model(mesh, repair=repair)
    lattice, record = read_lattice(file, model), as_mesh(model)
    if cells is not None:
        _write_cells(lattice, cells)
    parts = [_definition_facts(m.definition) | _settled_facts(m) for m in lattice.members]
    facts = _file_facts(lattice, parts)
    from ffdcli.fitting.lattice_fit import DEFAULT_TOLERANCE
    from ffdcli.fitting.parametrization import parametrize

    if lattice.needs_fit:
        facts["default_fit_tolerance"] = DEFAULT_TOLERANCE * record.size
        facts["parametrization"] = parametrize(record, lattice).report
    facts["jacobian"] = folding_facts(record, lattice, fit_tolerance)
    if injective_scale:
        facts["injective_scale"] = _scale_facts(record, lattice, progress)
    return {**facts, "warnings": list(lattice.warnings)}


def _file_facts(lattice: Lattice | LatticeFile, parts: list[Facts]) -> Facts:
    """Facts of a lattice file; of each lattice in a list if the file has a list."""
    if lattice.listed:
        return {"unit": lattice.unit, "lattices": parts}
    return {**parts[0], "unit": lattice.unit}


def _definition_facts(definition: Definition) -> Facts:
    """Facts of one lattice that stand in its file."""
    spec = definition.spec
    layout: Facts = {"points": list(spec.counts), "ends": spec.ends}
    if spec.octree is not None:
        layout = {"octree": spec.octree.written()}
    return {
        "volume": spec.volume,
        "degree": list(spec.degree),
        "box": "auto" if spec.box == "auto" else spec.box.model_dump(exclude_none=True),
        **layout,
        "edits": [edit.name for edit in spec.edits],
    }


def _write_cells(lattice: Lattice, output: Path) -> None:
    from ffdcli.errors import LatticeError
    from ffdcli.files import require_place, write_whole
    from ffdcli.lattice.file.cells import cells_text

    models = [member.cells for member in lattice.members]
    if len(models) != 1 or models[0] is None:
        message = "--cells needs a file of one lattice on an octree"
        hint = "use a lattice of `volume: tspline` or `volume: hierarchical`"
        raise LatticeError(message, file=lattice.source.name, hint=hint)
    require_place(output)
    write_whole(output, cells_text(models[0].tree).encode())


def _settled_facts(lattice: BoxLattice) -> Facts:
    """Facts of one lattice that depend on the mesh."""
    import numpy as np

    from ffdcli.lattice.fit.report import facts_of_fits

    volume = lattice.map
    displacement = np.linalg.norm(lattice.points - volume.rest_points, axis=-1)
    layout = lattice.layout
    box = layout.written_box
    automatic = {"box": {"min": box[0].tolist(), "max": box[1].tolist()}}
    if lattice.spec.octree is not None and lattice.spec.octree.region != "auto":
        size = (box[1] - box[0]).tolist()
        centre, axes = layout.frame.origin.tolist(), layout.frame.axes.tolist()
        automatic = {"box": {"center": centre, "size": size, "axes": axes}}
    weights = lattice.weights
    span = {"weights": {"min": float(weights.min()), "max": float(weights.max())}}
    return {
        **(automatic if lattice.spec.box == "auto" else {}),
        **_cell_facts(lattice),
        "moved_points": int(np.count_nonzero(displacement)),
        "max_displacement": float(displacement.max()),
        **(span if lattice.spec.weighted else {}),
        "locked_points": int(lattice.locked.sum()),
        "crossed_sides": list(lattice.crossed),
        **facts_of_fits([lattice.fits[number] for number in sorted(lattice.fits)]),
    }


def _scale_facts(mesh: Mesh, lattice: Lattice, progress: Progress) -> Facts:
    """Largest factor for the edits that is proved free of folds, and the smallest with a fold."""
    from ffdcli import injective_scale

    limit = injective_scale(mesh, lattice, progress=progress)
    at = None if limit.at is None else limit.at.tolist()
    return vars(limit) | {"at": at}


def _cell_facts(lattice: BoxLattice) -> Facts:
    """Numbers of cells, and for an octree of control points as in Song & Yang, Table 1."""
    import numpy as np

    volume, model = lattice.map, lattice.cells
    if model is None:
        planes = [volume.knot_planes(axis, volume.box[None]) for axis in range(3)]
        return {"cells": [each.values.shape[1] + 1 for each in planes]}
    tree, weighted = model.tree, not volume.linear_precision
    # The smallest regular lattice with all planes: T-spline control points lie on them.
    regular = tree.plane_counts + (0 if weighted else np.array(volume.degrees) - 1)
    counts = np.bincount(volume.levels).tolist()
    hidden = int(volume.hidden.sum())
    return {
        "cells": len(model.full),
        "cells_by_level": np.bincount(tree.levels).tolist(),
        "cells_with_mesh": int(model.full.sum()),
        "control_points": len(volume.hidden),
        "control_points_by_level": counts,
        "control_points_if_regular": int(np.prod(regular)),
        **({"exposed": len(volume.hidden) - hidden, "hidden": hidden} if weighted else {}),
    }
