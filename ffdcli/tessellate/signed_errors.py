"""Signed distances of the triangles of a mesh result from the exact surface, for colour maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.closedness import mesh_bodies
from ffdcli.deformation import Deformation
from ffdcli.tessellate.mesh_result import MeshResult
from ffdcli.verify.deformed_mesh import DeformedMesh
from ffdcli.verify.nearest_on_deformed_mesh import distances_to_deformed_mesh

# Distances below this share of the mesh size are rounding.
_SETTLE = 1e-13


@dataclass(frozen=True)
class SignedErrors:
    """Signed distances on a grid over each triangle.

    Parameters
    ----------
    points : (T, q, 3) float64, model length
        Grid points on the flat triangles.
    distance : (T, q) float64, model length
        Distance to the nearest point of the exact surface; positive if the flat triangle is outside
        of the surface, negative if it is inside.
    cells : (s, 3) int64
        Triangles of the grid, the same for all flat triangles: indices along the second axis.
    """

    points: Floats
    distance: Floats
    cells: Ints


def signed_errors(result: MeshResult, deformation: Deformation, parts: int = 4) -> SignedErrors:
    """Signed distances of triangles from the exact surface.

    ``max_deviation`` of the report is measured in the opposite direction, from the exact surface to
    the triangles; both are about the same.

    Each side of a triangle has ``parts`` grid intervals; the deformation is that of the result.
    """
    mesh = result.mesh
    places, cells = grid(parts)
    corners = result.points[result.triangles]
    points = places @ corners
    image = DeformedMesh(
        result.rest[result.triangles], mesh_bodies(result.triangles)[2], deformation
    )
    # The search starts from the image of the same barycentric point.
    triangle = np.repeat(np.arange(len(corners)), len(places))
    params = np.tile(places[:, 1:], (len(corners), 1))
    position = deformation.images(image.at(triangle, params))
    settle, enough = _SETTLE * mesh.size, max(2 * result.deviation, _SETTLE * mesh.size)
    feet = distances_to_deformed_mesh(
        image, (triangle, params, position), points.reshape(-1, 3), settle, enough, enough
    )
    foot = deformation.images(image.at(feet.owner, feet.params)).reshape(points.shape)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    beyond = np.einsum("tqi,ti->tq", points - foot, normal)
    distance = feet.distance.reshape(points.shape[:2])
    return SignedErrors(points, np.where(beyond < 0, -distance, distance), cells)


def grid(parts: int) -> tuple[Floats, Ints]:
    """Barycentric coordinates (q, 3) of a regular grid on a triangle, and its cells (parts², 3)."""
    index = [(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    number = {pair: n for n, pair in enumerate(index)}
    cells = []
    for i, j in index:
        if i + j < parts:
            cells.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < parts - 1:
            cells.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    share = np.array(index, dtype=np.float64) / parts
    return np.column_stack([1 - share.sum(axis=1), share]), np.array(cells, dtype=np.int64)
