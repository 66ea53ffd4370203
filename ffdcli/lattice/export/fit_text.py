"""Text of a lattice file that fits a field of displacements."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal

from ffdcli.lattice.export.save import flow_text
from ffdcli.lattice.export.starter import shell_word, unit_for

# Text that needs no quotes in YAML, and words that do.
_PLAIN = re.compile(r"(\.{1,2}/)*[A-Za-z_/][A-Za-z0-9_./-]*")
_WORDS = ("null", "true", "false", "yes", "no", "on", "off", "y", "n")
FitVolume = Literal["hierarchical", "bspline", "nurbs"]
FIT_VOLUMES: tuple[FitVolume, ...] = ("hierarchical", "bspline", "nurbs")


@dataclass(frozen=True)
class FitChoice:
    """What a lattice file with a fit says besides the field; None leaves a default.

    Parameters
    ----------
    volume : {"hierarchical", "bspline", "nurbs"}
    degree : int
        Along all axes.
    points : (int, int, int), optional
        Numbers of control points; not of hierarchical volumes.
    octree_depth : int, optional
        Of hierarchical volumes. By default cells are divided where the field needs it.
    max_depth, max_points : int, optional
        Limits of that.
    field, targets : str, optional
        Name of the field in a mesh file, or the file of the deformed mesh.
    unit : str, optional
        Length unit of the field, or of the scan.
    reach : float, optional
        Largest distance at which a point of a scan counts.
    scale, tolerance : float, optional
    smooth : float, optional
    robust : bool
    hold : tuple of str
        Names of groups of the mesh that stay.
    """

    volume: FitVolume = "hierarchical"
    degree: int = 3
    points: tuple[int, int, int] | None = None
    octree_depth: int | None = None
    max_depth: int | None = None
    max_points: int | None = None
    field: str | None = None
    targets: str | None = None
    unit: str | None = None
    reach: float | None = None
    scale: float | None = None
    tolerance: float | None = None
    smooth: float | None = None
    robust: bool = True
    hold: tuple[str, ...] = ()


def fit_text(
    choice: FitChoice,
    *,
    model: str,
    unit: str | None,
    lattice: str = "lattice.yaml",
    pairs: str | None = None,
    scan: str | None = None,
) -> str:
    """Text of a lattice file whose only edit is a fit.

    Parameters
    ----------
    choice : FitChoice
    model : str
        Name of the mesh or part for the comments.
    unit : str or None
        Length unit of the model's file.
    lattice : str
        Name of the lattice file for the comments.
    pairs : str, optional
        Path of the field, relative to the lattice file.
    scan : str, optional
        Path of a scan: without pairs the fit is onto it, else they were found for it.
    """
    what = f"The displacements of {shell_word(pairs or '')}"
    if scan is not None:
        what = f"The scan {shell_word(scan)}"
    lines = [
        f"# {what}, fitted for {shell_word(model)}. To deform:",
        f"#   ffd deform {shell_word(model)} {shell_word(lattice)} -o out.step",
        "version: 1",
        f"unit: {unit_for(unit)}",
        f"volume: {choice.volume}",
        f"degree: {[choice.degree] * 3}",
    ]
    if choice.volume == "hierarchical":
        lines.append(f"octree: {_flow(_octree(choice))}")
    elif choice.points is not None:
        lines.append(f"points: {list(choice.points)}")
    lines += ["edits:", "  - fit:"]
    keys = {
        "target": scan if pairs is None else None,
        "pairs": pairs,
        "field": choice.field,
        "targets": choice.targets,
        "unit": choice.unit,
        "reach": choice.reach,
        "scale": choice.scale,
        "tolerance": choice.tolerance,
        "smooth": choice.smooth,
        "robust": None if choice.robust else False,
        "hold": [{"group": name} for name in choice.hold] or None,
    }
    lines += [f"      {key}: {_flow(value)}" for key, value in keys.items() if value is not None]
    return "\n".join(lines) + "\n"


def _octree(choice: FitChoice) -> dict[str, Any]:
    limits = {"max_depth": choice.max_depth, "max_points": choice.max_points}
    given = {key: value for key, value in limits.items() if value is not None}
    return {"depth": "auto" if choice.octree_depth is None else choice.octree_depth, **given}


def _flow(value: Any) -> str:
    """A value on one line as a person writes it, without quotes where none are needed."""
    if isinstance(value, dict):
        inside = ", ".join(f"{key}: {_flow(each)}" for key, each in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
        return value
    return flow_text(value)
