"""The surface of a model in small triangles, and the nearest places on them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.winding import nearest_on_triangles

# Sizes of triangles that are told apart, each half of the one before.
_SIZES = 4


@dataclass(frozen=True, eq=False)
class Places:
    """The nearest places on a surface to points.

    Parameters
    ----------
    points : (m, 3) float64
    triangle : (m,) int64
    shares : (m, 3) float64
        Barycentric coordinates.
    distance : (m,) float64
    """

    points: Floats
    triangle: Ints
    shares: Floats
    distance: Floats


def divide(corners: Floats, size: float) -> tuple[Floats, Ints]:
    """Triangles with edges of at most ``size`` (t, 3, 3), and the one that each is part of (t,).

    The longest edge is halved again and again, so that thin triangles become few.
    """
    owner = np.arange(len(corners))
    while True:
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        long = edges.max(axis=1) > size
        if not long.any():
            order = np.argsort(owner, kind="stable")
            return corners[order], owner[order]
        rows, first = np.flatnonzero(long), edges[long].argmax(axis=1)
        a, b, c = (corners[rows, (first + step) % 3] for step in range(3))
        middle = (a + b) / 2
        halves = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
        corners = np.concatenate([corners[~long], *halves])
        owner = np.concatenate([owner[~long], owner[rows], owner[rows]])


def spread_out(corners: Floats, most: int) -> Floats:
    """At most ``most`` of the triangles, so that each stands for the same area."""
    if len(corners) <= most:
        return corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ends = np.cumsum(np.linalg.norm(normals, axis=1))
    marks = (np.arange(most) + 0.5) / most * ends[-1]
    return corners[np.unique(np.searchsorted(ends, marks))]


def unit_normals(corners: Floats) -> Floats:
    """(t, 3) unit normals of triangles; 0 without an area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def nearest_places(points: Floats, corners: Floats) -> Places:
    """The nearest places on triangles (t, 3, 3) to points (m, 3).

    Those with the nearest centres bound the distance; then all are compared that may be nearer,
    large triangles and small ones apart.
    """
    middles = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    share = radius.max() / radius.clip(max(radius.max() * 0.5**_SIZES, 1e-300), None)
    sizes = np.log2(share).clip(0, _SIZES - 1).astype(np.int64)
    classes = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    trees = [cKDTree(middles[rows]) for rows in classes]
    number = np.arange(len(points))
    near = np.stack(
        [rows[tree.query(points)[1]] for rows, tree in zip(classes, trees, strict=True)], axis=1
    )
    found = [(np.repeat(number, len(classes)), near.ravel())]
    feet = nearest_on_triangles(points[found[0][0]], corners[found[0][1]])
    bound = np.linalg.norm(feet - points[found[0][0]], axis=1).reshape(near.shape).min(axis=1)
    for rows, tree in zip(classes, trees, strict=True):
        lists = tree.query_ball_point(points, bound + radius[rows].max(), return_sorted=False)
        counts = np.array([len(each) for each in lists])
        which = np.fromiter(chain.from_iterable(lists), dtype=np.int64, count=counts.sum())
        owner, triangle = np.repeat(number, counts), rows[which]
        reach = np.linalg.norm(points[owner] - middles[triangle], axis=1) - radius[triangle]
        close = reach <= bound[owner]
        found.append((owner[close], triangle[close]))
    owner, triangle = (np.concatenate(each) for each in zip(*found, strict=True))
    feet = nearest_on_triangles(points[owner], corners[triangle])
    distance = np.linalg.norm(feet - points[owner], axis=1)
    order = np.lexsort((triangle, distance, owner))
    best = order[np.searchsorted(owner[order], number)]
    foot, triangle = feet[best], triangle[best]
    return Places(foot, triangle, _shares(foot, corners[triangle]), distance[best])


def _shares(points: Floats, corners: Floats) -> Floats:
    """Barycentric coordinates (m, 3) of points (m, 3) of triangles (m, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    aa, ab, bb, pa, pb = (
        np.einsum("mc,mc->m", u, v) for u, v in ((a, a), (a, b), (b, b), (p, a), (p, b))
    )
    whole = aa * bb - ab * ab
    sound = whole > 1e-12 * aa * bb
    whole = np.where(sound, whole, 1.0)
    second = np.where(sound, (bb * pa - ab * pb) / whole, 0.0)
    third = np.where(sound, (aa * pb - ab * pa) / whole, 0.0)
    found = np.stack([1 - second - third, second, third], axis=1).clip(0.0, 1.0)
    return np.asarray(found / found.sum(axis=1, keepdims=True))
