"""Bodies that overlap, as far as points of one inside another tell."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.mesh.polygons import triangles
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting
from ffdcli.mesh.winding import winding_numbers

# Points looked at for each body, and point-triangle pairs in all.
_MOST_POINTS = 32
_MOST_WORK = 4e6
# A winding number this far from whole belongs to a point on the surface itself.
_WHOLE = 0.05


def find_overlaps(mesh: Mesh, nesting: ShellNesting) -> Floats:
    """Points of closed bodies that lie in the material of others, one for each such body.

    Corners and middles of polygons are tried, as many as a share of a second allows: a body that is
    found does overlap; bodies that cross without any of these points inside are missed.

    Parameters
    ----------
    mesh : Mesh
        Its polygons do not cross themselves.
    nesting : ShellNesting

    Returns
    -------
    (n, 3) float64, model length
    """
    closed = np.flatnonzero(nesting.closed)
    if len(closed) < 2:
        return np.empty((0, 3))
    triangle, polygon = triangles(mesh)
    body = nesting.body[polygon]
    order = np.argsort(body, kind="stable")
    corners = mesh.vertices[triangle[order]]
    bounds = np.searchsorted(body[order], np.arange(len(nesting.closed) + 1))
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
        # A cavity's wall lies in the material of its parent, once.
        expected = 1.0 if nesting.parent[inner] >= 0 else 0.0
        others = np.concatenate([corners[bounds[n] : bounds[n + 1]] for n in near.tolist()])
        depth = winding_numbers(points, others)
        deep = (np.abs(depth - np.round(depth)) < _WHOLE) & (np.round(depth) > expected)
        found += points[deep][:1].tolist()
    return np.array(found).reshape(-1, 3)
