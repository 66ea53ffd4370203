"""Points of a scan for a registration: thinned evenly, with normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows
from ffdcli.scan.record import Scan
from ffdcli.scan.surface import divide, nearest_places

# Most points. Edges of a mesh longer than this share of its size are divided.
_MOST = 12_000
_LONGEST = 1 / 12
# Cells for thinning: the first size, relative to that of the scan, and its growth.
_FINEST = 1 / 400
_GROWTH = 1.15
# Neighbour whose distance is the spacing; spacings within which the scan reaches a place; share of
# a corner at which a place is on the edge opposite to it.
_AROUND = 4
_GAP = 1.5
_ON_EDGE = 1e-6
# Neighbours for the normals of clouds. They lie in a plane where the least spread is below a share
# of the next, and that is no line.
_NEAR = 12
_FLAT = 0.15
_WIDE = 1e-3
# Length of the mean of unit normals around a vertex, from which on the surface is smooth there.
_SMOOTH = 0.8
# Cosines of the largest angle between normals of one surface, and of one plane.
_ALIKE = 0.5
_PARALLEL = 0.95
_NO_EDGES = np.zeros((0, 3), dtype=bool)


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of a scan.

    Parameters
    ----------
    points : (n, 3) float64
    normals : (n, 3) float64
        Unit normals; 0 where there is none to tell.
    oriented : bool
        Whether all normals point to the same side of the surface.
    spacing : float
        Usual distance of a few neighbours.
    corners : (t, 3, 3) float64
        The scan in small triangles; none of a point cloud.
    open : (t, 3) bool
        Whether the edge opposite to each corner is an open edge of the scan.
    """

    points: Floats
    normals: Floats
    oriented: bool
    spacing: float
    corners: Floats
    open: Bools

    def gaps(self, points: Floats, normals: Floats) -> tuple[Floats, Bools]:
        """(m,) distances of places (m, 3) from the scan, and which of them it does not reach.

        The distance is that from the triangles of a mesh, or from the plane at the nearest point
        of a cloud, NaN where that is no plane of the place. Where a mesh ends the nearest place is
        on an open edge; where anything else begins the normals of the places do not agree.
        """
        known = np.flatnonzero(self.normals.any(axis=1))
        if not len(known):
            known = np.arange(len(self.points))
        apart, nearest = cKDTree(self.points[known]).query(points)
        rows = known[nearest]
        beside = (apart > _GAP * self.spacing) | ~self.agree(rows, normals)
        if len(self.corners):
            found = nearest_places(points, self.corners)
            at_edge = (found.shares < _ON_EDGE) & self.open[found.triangle]
            return found.distance, beside | at_edge.any(axis=1)
        planes = self.normals[rows]
        across = np.abs(np.einsum("mc,mc->m", points - self.points[rows], planes))
        flat = np.abs(np.einsum("mc,mc->m", planes, normals)) > _PARALLEL
        return np.where(flat, across, np.nan), beside

    def agree(self, rows: Ints, normals: Floats) -> Bools:
        """Which points, by their numbers (m,), have a normal like that given (m, 3), or none."""
        own = self.normals[rows]
        cosine = np.einsum("mc,mc->m", own, normals)
        if not self.oriented:
            cosine = np.abs(cosine)
        return np.asarray((cosine >= _ALIKE) | ~own.any(axis=1))


def take_samples(scan: Scan, most: int = _MOST) -> Samples:
    """Points of a scan, the same for the same scan: the first in each of many cubes."""
    points, normals, small, opened = scan.points, scan.normals, np.zeros((0, 3, 3)), _NO_EDGES
    if len(scan.triangles):
        points, normals, small, opened = _mesh_points(scan)
    rows = _thinned(points, scan.size, most)
    points = points[rows]
    apart = cKDTree(points).query(points, k=min(_AROUND + 1, len(points)))[0]
    spacing = float(np.median(apart[:, -1]))
    if normals is None:
        return Samples(points, _plane_normals(points), False, spacing, small, opened)
    return Samples(points, _unit(normals[rows]), bool(len(small)), spacing, small, opened)


def _mesh_points(scan: Scan) -> tuple[Floats, Floats, Floats, Bools]:
    """Vertices and points inside large triangles, their normals, and small triangles of all."""
    corners = scan.points[scan.triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    at_vertex, whole = np.zeros_like(scan.points), np.zeros(len(scan.points))
    for corner in range(3):
        np.add.at(at_vertex, scan.triangles[:, corner], area)
        np.add.at(whole, scan.triangles[:, corner], np.linalg.norm(area, axis=1))
    # At a sharp edge there is no normal.
    at_vertex[np.linalg.norm(at_vertex, axis=1) < _SMOOTH * whole] = 0
    small, owner = divide(corners, scan.size * _LONGEST)
    inside = np.bincount(owner, minlength=len(corners))[owner] > 1
    points = np.concatenate([scan.points, small[inside].mean(axis=1)])
    return points, np.concatenate([at_vertex, area[owner[inside]]]), small, _open(small)


def _open(corners: Floats) -> Bools:
    """(t, 3) whether the edge opposite to each corner belongs to one triangle alone."""
    places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.sort(np.stack([np.roll(places, -1, axis=1), np.roll(places, 1, axis=1)], axis=2))
    _, which = distinct_rows(edges.reshape(-1, 2))
    return np.asarray((np.bincount(which)[which] == 1).reshape(-1, 3))


def _thinned(points: Floats, size: float, most: int) -> Ints:
    """Numbers of the points kept, ascending."""
    cell = size * _FINEST
    while True:
        cubes = np.floor((points - points.min(axis=0)) / max(cell, 1e-300)).astype(np.int64)
        which = distinct_rows(cubes)[1]
        rows = np.unique(which, return_index=True)[1]
        if len(rows) <= most:
            return np.sort(rows)
        cell *= max(_GROWTH, np.sqrt(len(rows) / most) * 0.95)


def _plane_normals(points: Floats) -> Floats:
    """Normals (n, 3) of the planes through neighbours; 0 where these lie in no plane."""
    near = cKDTree(points).query(points, k=min(_NEAR, len(points)))[1]
    around = points[near] - points[near].mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    flat = (spread[:, 0] < _FLAT * spread[:, 1]) & (spread[:, 1] > _WIDE * spread[:, 2])
    return np.where(flat[:, None], axes[:, :, 0], 0.0)


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
