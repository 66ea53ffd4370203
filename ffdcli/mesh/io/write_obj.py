"""Triangles as an OBJ file, and their materials as the file beside it: every digit kept.

The general writer takes groups apart into bodies of their own, and keeps eight decimals.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.paint import Paint


def as_obj(
    vertices: Floats,
    triangles: Ints,
    uv: Floats | None,
    label: Ints,
    names: list[list[str]],
    paint: Paint,
    material: list[int],
    library: Path | None,
) -> bytes:
    """The file; vertices stand there once for all groups.

    Parameters
    ----------
    uv : (T, 3, 2) float64 or None
    label : (T,) int64
        Position of each triangle's in ``names`` and ``material``.
    names : list of list of str
    material : list of int
    library : Path or None
        The file of materials.
    """
    lines = [] if library is None else [f"mtllib {library.name}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    place = None
    if uv is not None:
        # Places that are not there come last.
        rows = np.where(np.isnan(uv), np.inf, uv).reshape(-1, 2)
        table, place = np.unique(rows, axis=0, return_inverse=True)
        table = table[np.isfinite(table[:, 0])]
        place = np.where(place < len(table), place + 1, 0).reshape(-1, 3)
        lines += [f"vt {u!r} {v!r}" for u, v in table.tolist()]
    # Names and materials hold until the next.
    grouped, used = False, -1
    for number, row in enumerate(names):
        if row or grouped:
            lines.append(" ".join(["g", *("_".join(word.split()) for word in row)]))
            grouped = True
        if material[number] != used and material[number] >= 0:
            used = material[number]
            lines.append(f"usemtl {paint.names[used]}")
        chosen = label == number
        lines += _faces(triangles[chosen] + 1, None if place is None else place[chosen])
    return ("\n".join(lines) + "\n").encode()


def _faces(corners: Ints, place: Ints | None) -> Iterator[str]:
    if place is None:
        yield from (f"f {a} {b} {c}" for a, b, c in corners.tolist())
        return
    for (a, b, c), (p, q, r) in zip(corners.tolist(), place.tolist(), strict=True):
        yield f"f {a}/{p} {b}/{q} {c}/{r}" if p else f"f {a} {b} {c}"


def as_mtl(paint: Paint, folder: Path) -> bytes:
    """The materials; images are named as they are found from the folder (Path) of the file."""
    lines = []
    for name, material in zip(paint.names, paint.materials, strict=True):
        lines.append(f"newmtl {name}")
        if material.colour is not None:
            lines.append("Kd " + " ".join(map(repr, map(float, material.colour))))
        if material.image is not None:
            lines.append(f"map_Kd {_from(folder, material.image)}")
    return ("\n".join(lines) + "\n").encode()


def _from(folder: Path, image: str) -> str:
    try:
        return Path(os.path.relpath(image, folder)).as_posix()
    except ValueError:  # on another drive
        return Path(image).absolute().as_posix()
