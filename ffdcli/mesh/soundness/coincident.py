"""Closed bodies that lie on one another, vertex on vertex."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting

# Volumes that differ by no more than this share of the box are equal up to rounding.
_SAME_VOLUME = 1e-9


def find_coincident(mesh: Mesh, nesting: ShellNesting) -> Ints:
    """Closed bodies whose vertices and volume are those of an earlier one, whichever way they face.

    Returns
    -------
    (n, 2) int64
        The body and the earlier one. Polygons need not be the same: a square may be two triangles.
    """
    closed = np.flatnonzero(nesting.closed)
    boxes = np.concatenate([*nesting.boxes], axis=1)[closed]
    alike = closed[_repeated(boxes)]
    if not len(alike):
        return np.empty((0, 2), dtype=np.int64)
    body = nesting.body[mesh.polygon_of_corner]
    chosen = np.isin(body, alike)
    _, point = np.unique(mesh.vertices[mesh.corners[chosen]], axis=0, return_inverse=True)
    rows = np.unique(np.column_stack([body[chosen], point.ravel()]), axis=0)
    starts = np.flatnonzero(np.diff(rows[:, 0], prepend=-1))
    low, high = nesting.boxes
    volumes = np.abs(nesting.volume)
    known: dict[bytes, list[int]] = {}
    found = []
    for first, points in zip(starts.tolist(), np.split(rows[:, 1], starts[1:]), strict=True):
        own = int(rows[first, 0])
        slack = _SAME_VOLUME * float(np.prod(high[own] - low[own]))
        before = known.setdefault(points.tobytes(), [])
        other = next((b for b in before if abs(volumes[own] - volumes[b]) <= slack), None)
        if other is None:
            before.append(own)
        else:
            found.append((own, other))
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _repeated(rows: Floats) -> Bools:
    """(n,) whether a row is there more than once."""
    _, number, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(counts[number.ravel()] > 1)
