"""Signed distances of a mesh result's flat triangles from the exact surface, for colour maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.closedness import mesh_bodies
from ffdcli.deformation import Deformation
from ffdcli.tessellate.result import MeshResult
from ffdcli.verify.image import Image, distances_to_image

# What rounding leaves of a distance, as a share of the size.
_SETTLE = 1e-13


@dataclass(frozen=True)
class SignedErrors:
    """Distances on a grid over every triangle.

    Parameters
    ----------
    points : (T, q, 3) float64, model length
        On the flat triangles.
    distance : (T, q) float64, model length
        To the nearest point of the exact surface; positive where the flat triangle lies outside
        of it, negative where it lies inside.
    cells : (s, 3) int64
        Small triangles of the grid, alike in all triangles: indices along the second axis.
    """

    points: Floats
    distance: Floats
    cells: Ints


def signed_errors(result: MeshResult, deformation: Deformation, parts: int = 4) -> SignedErrors:
    """Measure how far the triangles are from the exact surface, and on which side.

    The other way round than ``max_deviation``, which looks from the exact surface at the triangles;
    both are about the same.

    Parameters
    ----------
    result : MeshResult
    deformation : Deformation
        That made it.
    parts : int
        Parts of each triangle's sides in the grid.
    """
    mesh = result.mesh
    places, cells = grid(parts)
    corners = result.points[result.triangles]
    points = places @ corners
    image = Image(result.rest[result.triangles], mesh_bodies(result.triangles)[2], deformation)
    # Where a point of a flat triangle belongs is the best place to start from.
    triangle = np.repeat(np.arange(len(corners)), len(places))
    params = np.tile(places[:, 1:], (len(corners), 1))
    position = deformation.images(image.at(triangle, params))
    settle, enough = _SETTLE * mesh.size, max(2 * result.deviation, _SETTLE * mesh.size)
    feet = distances_to_image(
        image, (triangle, params, position), points.reshape(-1, 3), settle, enough
    )
    foot = deformation.images(image.at(feet.owner, feet.params)).reshape(points.shape)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    beyond = np.einsum("tqi,ti->tq", points - foot, normal)
    distance = feet.distance.reshape(points.shape[:2])
    return SignedErrors(points, np.where(beyond < 0, -distance, distance), cells)


def grid(parts: int) -> tuple[Floats, Ints]:
    """Barycentric places (q, 3) of a regular grid over a triangle, and its cells (parts², 3)."""
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
