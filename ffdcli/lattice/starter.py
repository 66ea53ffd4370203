"""The starter lattice file: every key with its meaning, fitted to a mesh."""

from __future__ import annotations

import shlex
import textwrap

import numpy as np
from numpy.typing import NDArray

from ffdcli.lattice.edit_models import EDITS
from ffdcli.lattice.layout import automatic_corners
from ffdcli.lattice.spec import LatticeSpec
from ffdcli.units import UNIT_NAMES

Floats = NDArray[np.float64]

_WIDTH = 92


def starter_text(
    *, mesh: str, bounds: Floats, delta: float, unit: str | None, lattice: str = "lattice.yaml"
) -> str:
    """A commented lattice file for a mesh; as it stands it leaves the mesh as it is.

    Parameters
    ----------
    mesh : str
        Name of the mesh file, for the comments.
    bounds : (2, 3) float64, model length
    delta : float, model length
        See :meth:`ffdcli.lattice.lattice.Lattice.settle`.
    unit : str or None
        Length unit of the mesh, if its file states one.
    lattice : str
        Name of the lattice file itself, for the comments.
    """
    box = automatic_corners(bounds, delta)
    counts = LatticeSpec(version=1).counts
    values = {
        "version": "1",
        "volume": "bspline",
        "degree": "[3, 3, 3]",
        "points": str(list(counts)),
        "box": "auto",
        "knots": "null",
        "ends": "clamped",
        "unit": "mm" if unit is None else unit if unit in UNIT_NAMES else "null",
        "border": "c1",
        "octree": "null",
        "edits": "",
    }
    lines = [
        "# The lattice that ffd deforms a mesh with. When you have edited it, run:",
        f"#   ffd deform {_word(mesh)} {_word(lattice)} -o out.step",
        "#",
        f"# The mesh spans {_vector(bounds[0])} to {_vector(bounds[1])}.",
    ]
    for key, info in LatticeSpec.model_fields.items():
        lines.append("")
        lines.extend(_comment(info.description or ""))
        if key == "box":
            lines.append(f"# Here auto is {{min: {_vector(box[0])}, max: {_vector(box[1])}}}")
        lines.append(f"{key}: {values[key]}".rstrip())
    for name, example in _examples(box, counts).items():
        lines.append("")
        lines.extend(_comment(EDITS[name].__doc__ or "", indent="  "))
        lines.append(f"  # - {name}: {example}")
    return "\n".join(lines) + "\n"


def _examples(box: Floats, counts: tuple[int, int, int]) -> dict[str, str]:
    """One edit of each kind, gentle for this box."""
    step = 0.1 * float((box[1] - box[0]).max())
    middle = [count // 2 for count in counts]
    centre = (box[0] + box[1]) / 2
    knots = ", ".join(str(value) for value in (0.25, 0.75))
    return {
        "move": f"{{at: [{middle[0]}, {middle[1]}, -1], by: [0, 0, {_number(step)}]}}",
        "transform": '{at: [":", ":", -1], scale: [1.1, 1.1, 1], rotate: {axis: w, angle: 10}}',
        "twist": "{axis: w, angle: 20}",
        "taper": "{axis: w, factor: 0.8}",
        "bend": "{axis: w, toward: u, angle: 20}",
        "weight": f"{{at: [{middle[0]}, {middle[1]}, -1], value: 2}}",
        "move_knots": f"{{axis: u, values: [{knots}]}}",
        "drag": f"{{pairs: [{{from: {_vector(centre)}, by: [0, 0, {_number(step)}]}}]}}",
        "hammer": f"{{point: {_vector(centre)}, height: {_number(step)}}}",
        "crimp": f"{{point: {_vector(centre)}, sharpness: 2}}",
        "net": "net.npy",
        "weights": "weights.npy",
    }


def _comment(text: str, indent: str = "") -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(
        text, width=_WIDTH, initial_indent=prefix, subsequent_indent=prefix, break_long_words=False
    )


def _word(name: str) -> str:
    """A file name as a shell wants it, on one line."""
    return shlex.quote(" ".join(name.splitlines()))


def _number(value: float) -> str:
    return f"{value:.3g}"


def _vector(values: Floats) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"
