"""Wrong usage of `ffd deform`: options that do not go together, or not with the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ffdcli.brep.occ.formats import CAD_FORMATS, require_writable
from ffdcli.formats import mesh_format

_CAD = tuple(dict.fromkeys(CAD_FORMATS.values()))
_MESH = ("a mesh format",)
# The kinds of output that options are for.
_KINDS = {
    "--patches": _CAD,
    "--coplanar-distance": _CAD,
    "--coplanar-angle": _CAD,
    "--tolerance": _CAD,
    "--max-degree": _CAD,
    "--target": _CAD,
    "--schema": ("STEP",),
    "--iges-mode": ("IGES",),
    "--writer direct": ("STEP",),
    "--check": _CAD,
    "--mesh-mode": _MESH,
    "--mesh-tolerance": _MESH,
    "--dry-run": _CAD,
}


def reject_wrong_usage(kind: str | None, options: dict[str, Any]) -> None:
    """Raise an error for options that do not go together, or not with the kind of output.

    Parameters
    ----------
    kind : str or None
        Format of CAD output, ``a mesh format``, or None where nothing is written.
    options : dict of str to value
        None where an option is not given.
    """
    given = {option: value for option, value in options.items() if value is not None}
    for option, kinds in _KINDS.items():
        if option in given and kind is not None and kind not in kinds:
            raise click.UsageError(f"{option} needs an output in {' or '.join(kinds)}.")
    mode = given.get("--mesh-mode")
    for wrong, message in (
        (
            "--coplanar-distance" in given and "--coplanar-angle" not in given,
            "--coplanar-distance needs --coplanar-angle.",
        ),
        (
            "--max-degree" in given and "--tolerance" not in given,
            "--max-degree needs --tolerance.",
        ),
        (
            "--no-check" in given and "--check" in given,
            "--check and --no-check exclude each other.",
        ),
        (
            "--dry-run" in given and "--require-injective" in given,
            "--dry-run rejects nothing for folds: omit --require-injective.",
        ),
        (
            mode is not None and "--fit-tolerance" in given,
            f"--mesh-mode {mode} does not fit: omit --fit-tolerance.",
        ),
        (
            mode == "vertices" and "--mesh-tolerance" in given,
            "--mesh-mode vertices has no tolerance: omit --mesh-tolerance.",
        ),
    ):
        if wrong:
            raise click.UsageError(message)


def reject_for_curved(options: dict[str, Any]) -> None:
    """Raise an error for options that only meshes have a use for."""
    for option in (name for name, value in options.items() if value is not None):
        raise click.UsageError(f"{option} needs a mesh, or a part of planes and straight edges.")


def require_places(output: Path | None, unit: str | None, report_file: Path | None) -> None:
    """Raise an error, before any work, for output files that cannot be written."""
    from ffdcli.files import require_place

    if output is not None and mesh_format(output) is not None:
        from ffdcli.tessellate.mesh_result import require_mesh_output

        require_mesh_output(output, unit)
    elif output is not None:
        require_writable(output)
    if report_file is not None:
        require_place(report_file)
