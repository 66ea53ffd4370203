"""Triangles of glTF primitives: lists, strips and fans (3.7.2.1 of the standard)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Ints
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable

# Modes of primitives; lower ones are points and lines.
LIST, _STRIP, _FAN = 4, 5, 6


def is_surface(primitive: Entry) -> bool:
    """Whether a primitive is of triangles and has positions: others show no surface."""
    mode = primitive.whole("mode", LIST, most=_FAN)
    return mode >= LIST and "POSITION" in primitive.entry("attributes")


def promised_triangles(mode: int, corners: int) -> int:
    """Triangles that a primitive of this mode with so many corners stands for."""
    return corners // 3 if mode == LIST else max(corners - 2, 0)


def make_triangles(
    primitive: Entry, indices: NDArray[Any] | None, vertices: int
) -> tuple[Ints, int]:
    """Triangles of a primitive, and the number of those left out of strips.

    Parameters
    ----------
    indices : (n, 1) unsigned or None
        Vertices of the corners; None for every vertex in turn.
    vertices : int
        Number of vertices.

    Returns
    -------
    (T, 3) int64
    int
        Triangles with a corner twice, by which strips are joined.

    Raises
    ------
    Unreadable
        A corner without a vertex, or corners left over.
    """
    if indices is None:
        corners = np.arange(vertices)
    else:
        corners = indices[:, 0].astype(np.int64)
        top = int(corners.max(initial=0))
        if len(corners) and top == np.iinfo(indices.dtype).max:
            raise Unreadable(f"{primitive.at('indices')} hold {top}, which stands for no vertex")
        if len(corners) and top >= vertices:
            raise Unreadable(
                f"{primitive.at('indices')} refer to vertex {top} (counted from 0), "
                f"but there are {vertices}"
            )
    mode = primitive.whole("mode", LIST)
    if mode == LIST:
        if len(corners) % 3:
            raise Unreadable(f"{primitive.place} has {len(corners)} corners, not three by three")
        return corners.reshape(-1, 3), 0
    if len(corners) in (1, 2):
        raise Unreadable(f"{primitive.place} has only {len(corners)} corners")
    first, second, third = corners[:-2], corners[1:-1], corners[2:]
    if mode == _FAN:
        return np.column_stack([second, third, np.broadcast_to(corners[:1], len(third))]), 0
    odd = np.arange(len(first)) % 2 == 1
    found = np.column_stack([first, np.where(odd, third, second), np.where(odd, second, third)])
    whole = (first != second) & (second != third) & (third != first)
    return found[whole], int(np.count_nonzero(~whole))
