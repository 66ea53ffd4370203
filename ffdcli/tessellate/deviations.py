"""Deviations of the flat triangles of a net from the exact surface, measured on dense grids.

Each flat triangle replaces the image of an undeformed triangle. Grid points of the undeformed
triangle are deformed exactly, and their distance from the flat triangle is measured; for edges
between faces, the distance from the chord, which holds for both faces. The grid is finer where a
triangle crosses many polynomial pieces of the volume, so that it resolves them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.deformation import Deformation
from ffdcli.mesh.triangle_net import TriangleNet

# Number of grid intervals along an edge that crosses at most two polynomial pieces; more pieces
# give more intervals, up to a limit.
COARSE, DENSE = 4, 6
_FINEST = 96
# Number of points deformed at once.
_CHUNK = 100_000


@dataclass(frozen=True)
class Deviations:
    """Largest distances found, model length; NaN if not measured yet.

    Exact edges (E,) are measured from their chords or, within faces, from the nearer of two
    triangles; the exact surface of each triangle (T,) from the flat triangle.
    """

    edges: Floats
    triangles: Floats

    @property
    def largest(self) -> float:
        """Largest of all distances."""
        return float(max(self.edges.max(initial=0.0), self.triangles.max(initial=0.0)))


def unknown(net: TriangleNet) -> Deviations:
    """Deviations of a net that is not measured yet."""
    return Deviations(np.full(len(net.ends), np.nan), np.full(len(net.triangles), np.nan))


def measure(
    net: TriangleNet, points: Floats, deformation: Deformation, known: Deviations, density: int
) -> Deviations:
    """Measure the deviations that are not known.

    Parameters
    ----------
    points : (V, 3) float64, model length
        Images of the net's vertices.
    density : int
        Number of grid intervals along an edge that crosses at most two polynomial pieces.
    """
    edges, triangles = known.edges.copy(), known.triangles.copy()
    asked = np.flatnonzero(np.isnan(edges))
    for rows, grid in _grids(net.rest[net.ends[asked]], deformation, density, segment_grid):
        which = asked[rows]
        exact = _images(net.rest[net.ends[which]], grid, deformation)
        edges[which] = _from_edges(net, points, which, exact)
    asked = np.flatnonzero(np.isnan(triangles))
    for rows, grid in _grids(net.rest[net.triangles[asked]], deformation, density, triangle_grid):
        which = asked[rows]
        exact = _images(net.rest[net.triangles[which]], grid, deformation)
        distance = distances_from_triangles(exact, points[net.triangles[which]])
        triangles[which] = distance.max(axis=1, initial=0.0)
    return Deviations(edges, triangles)


def _grids(
    corners: Floats, deformation: Deformation, density: int, grid: Callable[[int], Floats]
) -> list[tuple[Ints, Floats]]:
    """Chunks of items (m, n, 3) and their grids, the density times powers of two."""
    if not len(corners):
        return []
    # Up to two pieces need the basic grid, up to four the next finer one.
    finer = np.ceil(np.log2(np.maximum(deformation.count_pieces(corners), 2) / 2)).astype(np.int64)
    parts = np.minimum(density * 2**finer, _FINEST)
    out = []
    for size in np.unique(parts):
        rows, places = np.flatnonzero(parts == size), grid(int(size))
        pack = max(1, _CHUNK // len(places))
        out += [(rows[i : i + pack], places) for i in range(0, len(rows), pack)]
    return out


def segment_grid(parts: int) -> Floats:
    """Barycentric coordinates (n, 2) strictly between the ends."""
    share = np.arange(1, parts) / parts
    return np.column_stack([1 - share, share])


def triangle_grid(parts: int) -> Floats:
    """Barycentric coordinates (n, 3) strictly inside."""
    i, j = np.meshgrid(np.arange(1, parts), np.arange(1, parts), indexing="ij")
    inside = i + j < parts
    first, second = i[inside] / parts, j[inside] / parts
    return np.column_stack([1 - first - second, first, second])


def _images(corners: Floats, grid: Floats, deformation: Deformation) -> Floats:
    """Exact images (m, n, 3) of the grid points of items with corners (m, k, 3)."""
    places = grid @ corners
    return deformation.images(places.reshape(-1, 3)).reshape(places.shape)


def _from_edges(net: TriangleNet, points: Floats, edges: Ints, exact: Floats) -> Floats:
    """Largest distances (m,) of points (m, n, 3) of edges from the net."""
    ends = points[net.ends[edges]]
    from_chord = distances_from_segments(exact, ends[:, 0], ends[:, 1])
    inner = np.flatnonzero(net.inner[edges])
    if len(inner):
        pair = net.beside[edges[inner]] // 3
        first, second = (
            distances_from_triangles(exact[inner], points[net.triangles[pair[:, i]]])
            for i in range(2)
        )
        from_chord[inner] = np.minimum(first, second)
    return np.asarray(from_chord.max(axis=1, initial=0.0))


def distances_from_triangles(points: Floats, corners: Floats) -> Floats:
    """Distances (m, n) of points (m, n, 3) from their triangles (m, 3, 3)."""
    a, b, c = (corners[:, i] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    unit = normal / np.where(length > 0, length, 1.0)[:, None]
    height = np.abs(np.einsum("mni,mi->mn", points - a[:, None], unit))
    inside: Bools = np.broadcast_to((length > 0)[:, None], height.shape).copy()
    rim = np.full(height.shape, np.inf)
    for tail, head in ((a, b), (b, c), (c, a)):
        inward = np.cross(unit, head - tail)
        inside &= np.einsum("mni,mi->mn", points - tail[:, None], inward) >= 0
        rim = np.minimum(rim, distances_from_segments(points, tail, head))
    return np.where(inside, height, rim)


def distances_from_segments(points: Floats, tails: Floats, heads: Floats) -> Floats:
    """Distances (m, n) of points (m, n, 3) from the segments from tails to heads (m, 3)."""
    along = heads - tails
    square = np.einsum("mi,mi->m", along, along)
    arm = points - tails[:, None]
    share = np.einsum("mni,mi->mn", arm, along) / np.where(square > 0, square, 1.0)[:, None]
    arm = arm - np.clip(share, 0.0, 1.0)[:, :, None] * along[:, None]
    return np.asarray(np.linalg.norm(arm, axis=2))
