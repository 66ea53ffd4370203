"""Find the points that lie in a lattice box."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints


def in_box(points: Floats, box: Floats) -> Bools:
    """(m,) True for points (m, 3) in the closed box (2, 3)."""
    return np.all((points >= box[0]) & (points <= box[1]), axis=1)


def parts_in_box(points: Floats, box: Floats, size: int) -> list[Ints]:
    """Numbers of the points (m, 3) in the box (2, 3), in parts of at most ``size``."""
    inside = np.flatnonzero(in_box(points, box))
    return np.array_split(inside, -(-len(inside) // size)) if len(inside) else []
