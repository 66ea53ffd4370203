"""Drags as successions of single-point drags that lead to the same lattice."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from ffdcli.arrays import Floats
from ffdcli.files import write_whole
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.export.save import body_lines, file_text, flow_text, vector_text
from ffdcli.lattice.file.drag_models import HoldPoint
from ffdcli.lattice.file.edit_models import DragEdit, NetEdit, ShiftedNet, WeightsEdit
from ffdcli.lattice.lattice import Lattice
from ffdcli.messages import printable


@dataclass(frozen=True)
class DragStep:
    """One single-point drag, in model coordinates.

    Parameters
    ----------
    lattice : int
        Number of the lattice in a `lattices` list, or 0.
    edit : int
        Number of the `drag` edit that the step belongs to.
    source, displacement, target : (3,) float64
        The dragged point, the displacement of its image, and the image after the step.
    """

    lattice: int
    edit: int
    source: Floats
    displacement: Floats
    target: Floats


def drag_steps(lattice: Lattice) -> tuple[DragStep, ...]:
    """Single-point drags that the drags of the file consist of, in order (Hu 2001, Eq. 16-19).

    A drag of weights or with rigid pieces is not a succession of point drags and has no steps.
    """
    return tuple(
        DragStep(
            place,
            number,
            member.layout.frame.to_model(source),
            member.layout.frame.turn_to_model(displacement),
            member.layout.frame.to_model(target),
        )
        for place, member in enumerate(lattice.members)
        for number, succession in member.successions.items()
        for source, displacement, target in succession.steps()
        # Held points that nothing would move need no step.
        if displacement.any()
    )


def steps_text(lattice: Lattice, folder: str | Path = ".") -> str:
    """Text of the lattice file with each drag replaced by its steps.

    ``folder`` is that of the new file, which paths in it are relative to.
    """
    comments = [
        f"# The drags of {printable(lattice.source.name)} as drags of one point each. The comment",
        "# after a step gives the image of the point after it. Held points have steps too.",
    ]
    steps = drag_steps(lattice)
    bodies = [
        _body(member, [step for step in steps if step.lattice == number], Path(folder))
        for number, member in enumerate(lattice.members)
    ]
    return file_text(lattice, comments, bodies)


def _body(member: BoxLattice, steps: list[DragStep], folder: Path) -> list[str]:
    """Lines of one lattice, with steps in place of its drags."""
    spec = member.spec
    interior = None if spec.knots is None else [np.array(values) for values in spec.knots]
    lines = body_lines(member, interior, folder)
    lines.append("edits:" if spec.edits else "edits: []")
    for number, edit in enumerate(spec.edits):
        if not isinstance(edit, DragEdit):
            lines.append(f"  - {flow_text(_moved_paths(edit, member.source.folder, folder))}")
        elif number not in member.successions:
            lines.append("  # Not a succession of point drags:")
            lines.append(f"  - {flow_text(_moved_paths(edit, member.source.folder, folder))}")
        else:
            options = _step_options(edit)
            lines.extend(
                f"  - drag: {{pairs: [{{from: {vector_text(step.source)}, "
                f"by: {vector_text(step.displacement)}}}]{options}}}"
                f"  # to {vector_text(step.target)}"
                for step in steps
                if step.edit == number
            )
    return lines


def save_steps(lattice: Lattice, path: str | Path) -> Path:
    """Write :func:`steps_text`, whole or not at all."""
    path = Path(path)
    write_whole(path, steps_text(lattice, path.parent).encode())
    return path


def _step_options(edit: DragEdit) -> str:
    """Options of a drag that apply to each of its steps, as YAML text."""
    held = tuple(hold for hold in edit.drag.hold if not isinstance(hold, HoldPoint))
    cost = "" if edit.drag.level_cost == 1 else f", level_cost: {edit.drag.level_cost!r}"
    kept = edit.drag.model_copy(update={"hold": held}).model_dump(by_alias=True, exclude_none=True)
    return (
        "".join(f", {key}: {flow_text(kept[key])}" for key in ("pin", "hold") if kept[key]) + cost
    )


def _moved_paths(edit: BaseModel, source: Path, folder: Path) -> Any:
    """An edit as plain values, with file names relative to another folder."""
    values = edit.model_dump(by_alias=True, exclude_none=True)

    def moved(name: Any) -> Any:
        return os.path.relpath(source / name, folder) if isinstance(name, str) else name

    if isinstance(edit, NetEdit) and isinstance(edit.net, ShiftedNet):
        values["net"]["points"] = moved(values["net"]["points"])
    elif isinstance(edit, NetEdit):
        values["net"] = moved(values["net"])
    elif isinstance(edit, WeightsEdit):
        values["weights"] = moved(values["weights"])
    elif isinstance(edit, DragEdit):
        values["drag"]["pairs"] = moved(values["drag"]["pairs"])
    return values
