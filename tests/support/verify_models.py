"""Boundary representations whose deformation is known in closed form, for the verifier's tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Brep, Curves, Planes, Surfaces
from ffdcli.deformation import Breaks
from ffdcli.mesh.record import Mesh
from support.brep_models import Mapping, cube

BOX_TRIANGLES = np.array(
    [
        corners
        for a, b, c, d in (
            (0, 1, 3, 2),
            (4, 6, 7, 5),
            (0, 4, 5, 1),
            (2, 3, 7, 6),
            (0, 2, 6, 4),
            (1, 5, 7, 3),
        )
        for corners in ((a, b, c), (a, c, d))
    ]
)


def triangle_mesh(points: Floats, triangles: Ints) -> Mesh:
    """A record of triangles."""
    return Mesh(points, triangles.ravel(), 3 * np.arange(len(triangles) + 1))


def derivative(mapping: Mapping, step: float = 1e-30) -> Mapping:
    """The exact Jacobian of a map made of arithmetic: complex steps lose no digits."""

    def jacobian(points: Floats) -> Floats:
        columns = [mapping(points + 1j * step * axis).imag / step for axis in np.eye(3)]
        return np.stack(columns, axis=2)

    return jacobian


@dataclass(frozen=True)
class Bent:
    """A deformation by a map made of arithmetic, for the verifier."""

    images: Mapping
    breaks: tuple[Breaks, ...] = ()
    degree: int = 9
    rational: bool = False
    needs_fit: bool = False
    alone: tuple[Bent, ...] = ()

    def jacobian(self, points: Floats) -> Floats:
        """Derivatives (n, 3, 3)."""
        return derivative(self.images)(points)


def gentle(points: Floats) -> Floats:
    """Bend space by a map of total degree 3: degree 3 on every plane and every line."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack(
        [
            x + 0.1 * y**3 - 0.1 * z**2 + 0.05 * x * y * z,
            y + 0.08 * z**3 - 0.05 * x**2 * z,
            z + 0.06 * x**2 * y - 0.05 * x**3 + 0.1 * y**2,
        ],
        axis=-1,
    )


def kinked(points: Floats) -> Floats:
    """Bend space by cubic splines in each coordinate with a simple knot at 1/2."""
    x, y, z = np.moveaxis(points, -1, 0)
    u, v, w = (np.where(t.real > 0.5, t - 0.5, 0) ** 3 for t in (x, y, z))
    return np.stack(
        [x + 0.4 * v * z + 0.2 * y**3, y + 0.3 * w + 0.2 * u * z**2, z + 0.5 * u * v], axis=-1
    )


@lru_cache
def sphere(level: int) -> tuple[Floats, Ints]:
    """Icosphere of radius 1: 20 · 4^level triangles."""
    g = (1 + 5**0.5) / 2
    points = np.array([(0, s, t * g) for s in (-1, 1) for t in (-1, 1)], dtype=float)
    points = np.concatenate([points, np.roll(points, 1, axis=1), np.roll(points, 2, axis=1)])
    far = np.linalg.norm(points[:, None] - points, axis=2)
    near = np.abs(far - 2) < 1e-9
    triangles = np.array(
        [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near[i, j] and near[j, k] and near[i, k]
        ]
    )
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    turned = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    for _ in range(level):
        sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        pairs, place = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        middle = place.reshape(-1, 3) + len(points)
        points = np.concatenate([points, points[pairs].mean(axis=1)])
        (a, b, c), (ab, bc, ca) = triangles.T, middle.T
        triangles = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return points / np.linalg.norm(points, axis=1, keepdims=True), triangles


def interpolator(degree: int, breaks: tuple[float, ...] = ()) -> tuple[Floats, Floats]:
    """Sites in [0, 1], and the matrix from values there to control points."""
    knots = np.r_[np.zeros(degree + 1), breaks, np.ones(degree + 1)]
    count = degree + 1 + len(breaks)
    sites = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(count)])
    return sites, np.linalg.inv(BSpline.design_matrix(sites, knots, degree).toarray())


def facets(points: Floats, triangles: Ints, mapping: Mapping, degree: int = 3) -> Brep:
    """Make every triangle of a closed mesh a face, over its dominant axis (one body)."""
    sites, inverse = interpolator(degree)
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, coedge_edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    corner = points[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    a = np.argmax(np.abs(normal), axis=1)
    b, c = (a + 1) % 3, (a + 2) % 3
    row = np.arange(len(triangles))
    flat = np.stack([corner[row, :, b], corner[row, :, c]], axis=2)
    low, high = flat.min(axis=1), flat.max(axis=1)
    span = low[:, None] + sites[:, None] * (high - low)[:, None]
    u, v = np.broadcast_arrays(span[:, :, None, 0], span[:, None, :, 1])
    slope = -normal / normal[row, a][:, None]
    grid = np.zeros((len(row), len(sites), len(sites), 3))
    np.put_along_axis(grid, b[:, None, None, None], u[..., None], axis=3)
    np.put_along_axis(grid, c[:, None, None, None], v[..., None], axis=3)
    height = (
        corner[row, 0, a][:, None, None]
        + slope[row, b][:, None, None] * (u - corner[row, 0, b][:, None, None])
        + slope[row, c][:, None, None] * (v - corner[row, 0, c][:, None, None])
    )
    np.put_along_axis(grid, a[:, None, None, None], height[..., None], axis=3)
    poles = np.einsum("ij,kl,fjlx->fikx", inverse, inverse, mapping(grid), optimize=True)
    ends = np.array([degree + 1, degree + 1])
    p, q = points[edges[:, :1]], points[edges[:, 1:]]
    curve = np.einsum("ij,ejx->eix", inverse, mapping(p + sites[:, None] * (q - p)))
    used = edges[coedge_edge]
    owner = np.repeat(row, 3)
    pcurves = np.stack([points[used, b[owner][:, None]], points[used, c[owner][:, None]]], axis=2)
    count = len(triangles)
    none = np.zeros((0, 3))
    return Brep(
        points=mapping(points),
        edges=edges,
        curves=(
            Curves(np.arange(len(edges)), degree, np.tile([0.0, 1], (len(edges), 1)), ends, curve),
        ),
        surfaces=(
            Surfaces(
                row,
                (degree, degree),
                np.stack([low[:, 0], high[:, 0]], axis=1),
                np.stack([low[:, 1], high[:, 1]], axis=1),
                ends,
                ends,
                poles,
            ),
        ),
        planes=Planes(np.zeros(0, int), none, none, none),
        face_surface=row,
        face_reversed=normal[row, a] < 0,
        face_loops=np.arange(count + 1),
        loop_coedges=3 * np.arange(count + 1),
        coedge_edge=coedge_edge.ravel(),
        coedge_forward=sides[:, 0] < sides[:, 1],
        pcurves=pcurves,
        face_shell=np.zeros(count, int),
        shell_closed=np.array([True]),
        shell_solid=np.array([0]),
        edge_tolerance=np.full(len(edges), 1e-7),
        vertex_tolerance=np.full(len(points), 1e-7),
    )


def kinked_cube(mapping: Callable[[Floats], Floats] = kinked) -> Brep:
    """The unit cube under a map with knots at 1/2: six bicubic surfaces of 5 × 5 poles."""
    plain = cube(mapping)
    sites, inverse = interpolator(3, (0.5,))
    corners = cube().points
    p, q = corners[plain.edges[:, :1]], corners[plain.edges[:, 1:]]
    knots, mults = np.array([0.0, 0.5, 1.0]), np.array([4, 1, 4])
    curves = np.einsum("ij,ejx->eix", inverse, mapping(p + sites[:, None] * (q - p)))
    u, v = np.meshgrid(sites, sites, indexing="ij")
    grid = np.zeros((6, 5, 5, 3))
    for face in range(6):
        axis = face // 2
        grid[face, ..., axis] = face % 2
        grid[face, ..., (axis + 1) % 3], grid[face, ..., (axis + 2) % 3] = u, v
    poles = np.einsum("ij,kl,fjlx->fikx", inverse, inverse, mapping(grid))
    both = np.tile(knots, (6, 1))
    return replace(
        plain,
        curves=(Curves(np.arange(12), 3, np.tile(knots, (12, 1)), mults, curves),),
        surfaces=(Surfaces(np.arange(6), (3, 3), both, both, mults, mults, poles),),
    )
