"""Solved lattice files: the control net and weights that edits lead to, in place of the edits."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.files import require_place, write_whole
from ffdcli.lattice.border import SIDES
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.file.spec import OrientedBox
from ffdcli.lattice.lattice import Lattice
from ffdcli.messages import printable

# Reading YAML takes about 0.1 ms per number, so larger nets go into .npy files.
MAX_INLINE_POINTS = 1000


def solved_text(lattice: Lattice, stem: str | None = None, folder: str | Path = ".") -> str:
    """Text of a lattice file with the control net, and weights if it has them, as only edits.

    All numbers are written in full: with the same mesh the file gives the same knots and control
    net to the last bit.

    Parameters
    ----------
    lattice : Lattice
    stem : str, optional
        Start of the names of .npy files for large nets; None writes all numbers into the text.
    folder : str or Path
        Folder of the lattice file, which the path of a file of cells is relative to.
    """
    bodies = []
    for number, member in enumerate(lattice.members):
        files = _file_names(lattice, number, stem)
        lines = [
            *body_lines(member, member.control.interior, Path(folder)),
            "edits:",
            *_net_lines(member, files.get("net")),
        ]
        if member.spec.weighted:
            lines.extend(_weight_lines(member.weights, files.get("weights")))
        bodies.append(lines)
    return file_text(
        lattice, [f"# Solved from {printable(lattice.source.name)}: all edits applied."], bodies
    )


def save_lattice(lattice: Lattice, path: str | Path) -> tuple[Path, ...]:
    """Write :func:`solved_text`, with .npy files beside it for a large net; return all files.

    Each file is written completely or not at all, the lattice file last.

    Raises
    ------
    FileError
        A file cannot be written.
    """
    path = Path(path)
    require_place(path)
    stem = printable(path.stem)
    text = solved_text(lattice, stem, path.parent)
    arrays: dict[Path, Floats] = {}
    for number, member in enumerate(lattice.members):
        held = {"net": member.points, "weights": member.weights}
        for kind, name in _file_names(lattice, number, stem).items():
            arrays[path.with_name(name)] = held[kind]
    for file, array in arrays.items():
        buffer = io.BytesIO()
        np.save(buffer, array)
        write_whole(file, buffer.getvalue())
    write_whole(path, text.encode())
    return (*arrays, path)


def _file_names(lattice: Lattice, number: int, stem: str | None) -> dict[str, str]:
    """Names of the .npy files of a member, by `net` and `weights`; none for small nets."""
    member = lattice.members[number]
    if stem is None or member.weights.size <= MAX_INLINE_POINTS:
        return {}
    kinds = ("net", "weights") if member.spec.weighted else ("net",)
    which = f".{number}" if lattice.listed else ""
    return {kind: f"{stem}{which}.{kind}.npy" for kind in kinds}


def file_text(lattice: Lattice, comments: Sequence[str], bodies: Sequence[Sequence[str]]) -> str:
    """Text of a lattice file, with a `lattices:` list if the lattice was read from one.

    ``bodies`` are the lines of each member: :func:`body_lines` and its edits.
    """
    lines = [*comments, "version: 1", f"unit: {lattice.unit or 'null'}"]
    if not lattice.listed:
        lines.extend(bodies[0])
    else:
        lines.append("lattices:")
        for first, *others in bodies:
            lines.append(f"  - {first}")
            lines.extend(f"    {line}" for line in others)
    return "\n".join(lines) + "\n"


def body_lines(member: BoxLattice, interior: Sequence[Floats] | None, folder: Path) -> list[str]:
    """Lines of one lattice before its edits, with the box that the mesh settled.

    ``interior`` are the knots, None for evenly spaced ones; ``folder`` holds the lattice file.
    """
    spec = member.spec
    borders = ", ".join(f"{side}: {spec.continuity(side)}" for side in SIDES)
    if spec.octree is not None:
        octree = spec.octree.written() | {"region": "auto"}
        if spec.grown:
            octree |= {"depth": 1, "also": _divided_boxes(member)}
        if spec.octree.cells is not None:
            octree["cells"] = os.path.relpath(member.source.folder / spec.octree.cells, folder)
        return [
            f"volume: {spec.volume}",
            f"degree: {list(spec.degree)}",
            f"box: {_box_text(member)}",
            f"octree: {flow_text(octree)}",
        ]
    knots = ["knots: null"]
    if interior is not None:
        knots = ["knots:", *(f"  - {values.tolist()}" for values in interior)]
    return [
        f"volume: {spec.volume}",
        f"degree: {list(spec.degree)}",
        f"points: {list(spec.counts)}",
        f"box: {_box_text(member)}",
        *knots,
        f"ends: {spec.ends}",
        f"border: {{{borders}}}",
    ]


def _divided_boxes(member: BoxLattice) -> list[dict[str, Any]]:
    """The boxes of `also` for the cells that a fit divided: those that hold leaves alone."""
    assert member.cells is not None
    tree, corner = member.cells.tree, member.layout.written_box
    size = tree.high[:, 0] - tree.low[:, 0]
    # The parent of a leaf is divided; where it has divided parts too, these tell as well.
    low = tree.low // (2 * size[:, None]) * (2 * size[:, None])
    rows = np.unique(np.column_stack([low, 2 * size, tree.levels])[tree.levels > 1], axis=0)
    unit = (corner[1] - corner[0]) / tree.counts
    return [
        {
            "min": (corner[0] + row[:3] * unit).tolist(),
            "max": (corner[0] + (row[:3] + row[3]) * unit).tolist(),
            "depth": int(row[4]),
        }
        for row in rows
    ]


def vector_text(values: Sequence[float] | Floats) -> str:
    """Numbers as a YAML list, with all digits."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def flow_text(values: Any) -> str:
    """Plain values as YAML on one line, with all digits."""
    return json.dumps(values, ensure_ascii=False)


def _box_text(member: BoxLattice) -> str:
    box, octree, frame = member.spec.box, member.spec.octree, member.layout.frame
    if octree is not None and octree.region != "auto":
        axes = ", ".join(map(vector_text, frame.axes))
        size = vector_text(member.layout.box[1] - member.layout.box[0])
        return f"{{center: {vector_text(frame.origin)}, size: {size}, axes: [{axes}]}}"
    if isinstance(box, OrientedBox):
        axes = "" if box.axes is None else f", axes: [{', '.join(map(vector_text, box.axes))}]"
        return f"{{center: {vector_text(box.center)}, size: {vector_text(box.size)}{axes}}}"
    corners = member.layout.written_box
    return f"{{min: {vector_text(corners[0])}, max: {vector_text(corners[1])}}}"


def _net_lines(member: BoxLattice, net_file: str | None) -> list[str]:
    lines, indent = ["  - net:"], "      "
    origin = member.layout.written_origin
    # Adding the origin to control points would round them.
    shifted = bool(np.any(origin != 0))
    if net_file is not None and not shifted:
        return [f"  - net: {net_file}"]
    if shifted:
        lines.append(f"{indent}origin: {vector_text(origin)}")
        if net_file is not None:
            return [*lines, f"{indent}points: {net_file}"]
        lines.append(f"{indent}points:")
        indent += "  "
    if member.points.ndim == 2:
        return [*lines, *(f"{indent}- {vector_text(row)}" for row in member.points)]
    for layer in member.points:
        first = "- "
        for row in layer:
            lines.append(f"{indent}{first}- [{', '.join(map(vector_text, row))}]")
            first = "  "
    return lines


def _weight_lines(weights: Floats, weights_file: str | None) -> list[str]:
    if weights_file is not None:
        return [f"  - weights: {weights_file}"]
    lines = ["  - weights:"]
    if weights.ndim == 1:
        return [f"  - weights: {vector_text(weights)}"]
    for layer in weights:
        lines.append(f"      - [{', '.join(map(vector_text, layer))}]")
    return lines
