"""Text of a starter lattice file for a mesh, with a description of each key."""

from __future__ import annotations

import shlex
import textwrap
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.export.save import flow_text, vector_text
from ffdcli.lattice.file.check_spec import NEED_ROWS
from ffdcli.lattice.file.edit_models import EDITS
from ffdcli.lattice.file.spec import LatticeSpec, OctreeSpec
from ffdcli.lattice.layout import automatic_corners
from ffdcli.units import UNIT_NAMES

_WIDTH = 92


# Keys that an octree replaces, and keys of an octree that only apply to volumes with weights.
_IN_ROWS = ("points", "knots", "ends", "border")
_WEIGHTED = ("weights", "cells")
# Keys of an octree that only a fit may have.
_GROWN = ("max_depth", "max_points")


@dataclass(frozen=True)
class OctreeStart:
    """Options of a starter file for a lattice on an octree.

    Parameters
    ----------
    volume : {"tspline", "hierarchical"}
    depth : int
    place : (3,) float64, model coordinates
        Point of the mesh that the examples edit.
    """

    volume: str
    depth: int
    place: Floats

    @property
    def weighted(self) -> bool:
        """Whether control points have weights."""
        return self.volume == "tspline"


def starter_text(
    *,
    mesh: str,
    bounds: Floats,
    delta: float,
    unit: str | None,
    lattice: str = "lattice.yaml",
    octree: OctreeStart | None = None,
) -> str:
    """Text of a commented lattice file for a mesh, which leaves the mesh unchanged.

    Parameters
    ----------
    mesh : str
        Name of the mesh file for the comments.
    bounds : (2, 3) float64, model length
    delta : float, model length
        Distance within which points count as coplanar.
    unit : str or None
        Length unit of the mesh file.
    lattice : str
        Name of the lattice file for the comments.
    octree : OctreeStart, optional
        For a lattice on an octree.
    """
    box = automatic_corners(bounds, delta)
    counts = LatticeSpec(version=1).counts
    values = {
        "version": "1",
        "volume": "bspline" if octree is None else octree.volume,
        "degree": "[3, 3, 3]",
        "points": str(list(counts)),
        "box": "auto",
        "knots": "null",
        "ends": "clamped",
        "unit": unit_for(unit),
        "border": "c1",
        "octree": "null",
        "edits": "",
    }
    lines = [
        "# A lattice for deforming a mesh with ffd. Edit it, then run:",
        f"#   ffd deform {shell_word(mesh)} {shell_word(lattice)} -o out.step",
        "#",
        f"# The bounding box of the mesh: {vector_text(bounds[0])} to {vector_text(bounds[1])}.",
    ]
    for key, info in LatticeSpec.model_fields.items():
        if octree is not None and key in _IN_ROWS:
            continue
        lines.append("")
        lines.extend(_comment(info.description or ""))
        if key == "octree" and octree is not None:
            lines.extend(_octree_lines(octree))
            continue
        if key == "box":
            padded = ", enlarged by one finest cell" * (octree is not None and octree.weighted)
            lines.append(
                f"# Here auto is {{min: {vector_text(box[0])}, max: {vector_text(box[1])}}}{padded}"
            )
        lines.append(f"{key}: {values[key]}".rstrip())
    for name, example in _examples(box, counts, octree).items():
        lines.append("")
        lines.extend(_comment(EDITS[name].__doc__ or "", indent="  "))
        lines.append(f"  # - {name}: {example}")
    return "\n".join(lines) + "\n"


def unit_for(unit: str | None) -> str:
    """The key `unit` for a model of a unit; millimetres if its file states none."""
    return "mm" if unit is None else unit if unit in UNIT_NAMES else "null"


def _examples(
    box: Floats, counts: tuple[int, int, int], octree: OctreeStart | None
) -> dict[str, str]:
    """An example of each edit that the lattice can have, with small displacements for this box."""
    step = f"{0.1 * float((box[1] - box[0]).max()):.3g}"
    top = f"[{counts[0] // 2}, {counts[1] // 2}, -1]"
    place = vector_text((box[0] + box[1]) / 2 if octree is None else octree.place)
    middle = (box[0] + box[1]) / 2
    # At the middle of the box many normals of a mesh cancel: a peak stands on its top.
    peak = place if octree else vector_text(np.array([middle[0], middle[1], box[1, 2]]))
    examples = {
        "move": f"{{at: {top}, by: [0, 0, {step}]}}",
        "transform": '{at: [":", ":", -1], scale: [1.1, 1.1, 1], rotate: {axis: w, angle: 10}}',
        "twist": "{axis: w, angle: 20}",
        "taper": "{axis: w, factor: 0.8}",
        "bend": "{axis: w, toward: u, angle: 20}",
        "weight": f"{{at: {top}, value: 2}}",
        "move_knots": "{axis: u, values: [0.25, 0.75]}",
        "drag": f"{{pairs: [{{from: {place}, by: [0, 0, {step}]}}]}}",
        "fit": f"{{pairs: [{{from: {place}, by: [0, 0, {step}]}}], smooth: auto}}",
        "hammer": f"{{point: {peak}, height: {step}}}",
        "crimp": f"{{point: {peak}, sharpness: 2}}",
        "net": "net.npy",
        "weights": "weights.npy",
    }
    if octree is None:
        return examples
    level = "" if octree.weighted else f", level: {octree.depth}"
    near = f"{{near: {place}{level}}}"
    half = box + np.array([[0, 0, (box[1, 2] - box[0, 2]) / 2], [0, 0, 0]])
    inside = f"{{inside: {{min: {vector_text(half[0])}, max: {vector_text(half[1])}}}}}"
    examples["move"] = f"{{at: {near}, by: [0, 0, {step}]}}"
    examples["transform"] = f"{{at: {inside}, translate: [0, 0, {step}]}}"
    examples["weight"] = f"{{at: {near}, value: 200}}"
    without = (*NEED_ROWS, "fit") if octree.weighted else (*NEED_ROWS, "weight", "crimp", "weights")
    return {name: text for name, text in examples.items() if name not in without}


def _octree_lines(octree: OctreeStart) -> list[str]:
    """Lines with the keys of the octree and their descriptions."""
    lines = ["octree:"]
    for key, info in OctreeSpec.model_fields.items():
        if (key in _WEIGHTED and not octree.weighted) or key in _GROWN:
            continue
        value = octree.depth if key == "depth" else info.default
        lines.extend(_comment(info.description or "", indent="  "))
        lines.append(f"  {key}: {value if isinstance(value, str) else flow_text(value)}")
    return lines


def _comment(text: str, indent: str = "") -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(
        text, width=_WIDTH, initial_indent=prefix, subsequent_indent=prefix, break_long_words=False
    )


def shell_word(name: str) -> str:
    """A file name quoted for a shell, on one line."""
    return shlex.quote(" ".join(name.splitlines()))
