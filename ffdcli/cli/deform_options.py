"""Options of `ffd deform` that do not go together, and places where nothing can be written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ffdcli.brep.occ.formats import Writer, require_writable
from ffdcli.formats import mesh_format


def reject_unsuitable(kind: str | None, options: dict[str, tuple[Any, tuple[str, ...]]]) -> None:
    """Raise an error for options that do not apply to this kind of output."""
    for option, (value, kinds) in options.items():
        if value is not None and kind is not None and kind not in kinds:
            raise click.UsageError(f"{option} needs an output in {' or '.join(kinds)}.")


def reject_for_curved(mesh_file: Path | None, options: dict[str, Any]) -> None:
    """Raise an error for a mesh as output, and for options that only meshes have a use for."""
    if mesh_file is not None:
        raise click.UsageError(
            f"A part with curved faces is written as CAD (.step, .iges, .brep), not as {mesh_file}."
        )
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


def reject_for_dry_run(
    tolerance: float | None, writer: Writer | None, *, require_injective: bool
) -> None:
    """Raise an error for options that a dry run does nothing with."""
    if writer == "direct":
        raise click.UsageError("--dry-run estimates what OpenCascade takes: omit --writer direct.")
    if tolerance is not None:
        raise click.UsageError("--dry-run does not estimate the effect of --tolerance.")
    if require_injective:
        raise click.UsageError("--dry-run does not look for folds: omit --require-injective.")
