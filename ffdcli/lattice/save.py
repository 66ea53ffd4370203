"""Writing a solved lattice: a file whose only edit is the explicit control net."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffdcli.errors import LatticeError
from ffdcli.files import require_place, write_whole
from ffdcli.lattice.border import SIDES
from ffdcli.lattice.lattice import Lattice, Settled
from ffdcli.lattice.spec import OrientedBox

Floats = NDArray[np.float64]

# Reading YAML costs about 0.1 ms a number, so larger nets go into a .npy file beside it.
MAX_INLINE_POINTS = 1000


def solved_text(lattice: Lattice, net_file: str | None = None) -> str:
    """The lattice file of a settled lattice, with its control net as only edit.

    All numbers are written in full: reading the file for the same mesh gives the same knots and
    control net to the last bit.

    Parameters
    ----------
    net_file : str, optional
        Name of the .npy file that holds the net; None writes the net itself.
    """
    settled = lattice.settled
    if settled is None:
        raise LatticeError(
            "only a lattice settled by a mesh can be written", file=lattice.source.name
        )
    spec = lattice.spec
    borders = ", ".join(f"{side}: {spec.continuity(side)}" for side in SIDES)
    lines = [
        f"# Solved from {lattice.source.name}: all edits applied.",
        f"version: {spec.version}",
        f"volume: {spec.volume}",
        f"degree: {list(spec.degree)}",
        f"points: {list(spec.counts)}",
        f"box: {_box_text(lattice, settled)}",
        "knots:",
        *(f"  - {values.tolist()}" for values in settled.interior),
        f"ends: {spec.ends}",
        f"unit: {spec.unit or 'null'}",
        f"border: {{{borders}}}",
        "edits:",
    ]
    lines.extend(_net_lines(settled, net_file))
    return "\n".join(lines) + "\n"


def save_lattice(lattice: Lattice, path: str | Path) -> tuple[Path, ...]:
    """Write a settled lattice; a large net goes into a .npy file beside it.

    Files appear whole or not at all, the lattice file last.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    LatticeError
        The lattice is not settled.
    FileError
        A file cannot be written.
    """
    path = Path(path)
    require_place(path)
    net = lattice.volume.net
    if net[..., 0].size <= MAX_INLINE_POINTS:
        write_whole(path, solved_text(lattice).encode())
        return (path,)
    net_path = path.with_name(f"{path.stem}.net.npy")
    text = solved_text(lattice, net_path.name)
    buffer = io.BytesIO()
    np.save(buffer, net)
    write_whole(net_path, buffer.getvalue())
    write_whole(path, text.encode())
    return net_path, path


def _vector(values: Sequence[float] | Floats) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _box_text(lattice: Lattice, settled: Settled) -> str:
    box = lattice.spec.box
    if isinstance(box, OrientedBox):
        axes = "" if box.axes is None else f", axes: [{', '.join(map(_vector, box.axes))}]"
        return f"{{center: {_vector(box.center)}, size: {_vector(box.size)}{axes}}}"
    corners = settled.layout.written_box
    return f"{{min: {_vector(corners[0])}, max: {_vector(corners[1])}}}"


def _net_lines(settled: Settled, net_file: str | None) -> list[str]:
    lines, indent = ["  - net:"], "      "
    origin = settled.layout.written_origin
    # Control points keep all their digits only as the volume holds them, from its own origin.
    shifted = bool(np.any(origin != 0))
    if net_file is not None and not shifted:
        return [f"  - net: {net_file}"]
    if shifted:
        lines.append(f"{indent}origin: {_vector(origin)}")
        if net_file is not None:
            return [*lines, f"{indent}points: {net_file}"]
        lines.append(f"{indent}points:")
        indent += "  "
    for layer in settled.volume.net:
        first = "- "
        for row in layer:
            lines.append(f"{indent}{first}- [{', '.join(map(_vector, row))}]")
            first = "  "
    return lines
