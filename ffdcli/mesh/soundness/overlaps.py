"""Overlapping bodies, found by sample points of one inside another."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, triangles_by_body
from ffdcli.mesh.winding import winding_numbers

# Most sample points of a body, and most point-triangle pairs in all.
_MOST_POINTS = 32
_MOST_WORK = 4e6
# A winding number this far from an integer belongs to a point on the surface.
_WHOLE = 0.05


def find_overlaps(mesh: Mesh, nesting: ShellNesting) -> Floats:
    """Points of closed bodies inside the material of others, one for each such body.

    The samples are corners and middles of triangles, limited in number. A body that is found does
    overlap; bodies that cross without a sample point inside the other are missed.

    Parameters
    ----------
    mesh : Mesh
        Its polygons must not cross themselves.
    nesting : ShellNesting

    Returns
    -------
    (n, 3) float64, model length
    """
    closed = np.flatnonzero(nesting.closed)
    if len(closed) < 2:
        return np.empty((0, 3))
    triangle, bounds = triangles_by_body(mesh, nesting.body, len(nesting.closed))
    corners = mesh.vertices[triangle]
    low, high = nesting.boxes
    limit = int(np.clip(_MOST_WORK / len(corners) / len(closed), 4, _MOST_POINTS))
    found = []
    for inner in closed.tolist():
        near = closed[np.all((low[closed] < high[inner]) & (high[closed] > low[inner]), axis=1)]
        near = near[near != inner]
        if not len(near):
            continue
        own = corners[bounds[inner] : bounds[inner + 1]]
        points = np.concatenate([np.unique(own.reshape(-1, 3), axis=0), own.mean(axis=1)])
        inside = (points[:, None] > low[near]) & (points[:, None] < high[near])
        points = points[inside.all(axis=2).any(axis=1)]
        points = points[np.linspace(0, len(points) - 1, min(limit, len(points))).astype(int)]
        # The wall of a cavity has winding number 1 in its parent.
        expected = 1.0 if nesting.parent[inner] >= 0 else 0.0
        others = np.concatenate([corners[bounds[n] : bounds[n + 1]] for n in near.tolist()])
        depth = winding_numbers(points, others)
        deep = (np.abs(depth - np.round(depth)) < _WHOLE) & (np.round(depth) > expected)
        found += points[deep][:1].tolist()
    return np.array(found).reshape(-1, 3)
