"""Subdivide and deform the triangles of a mesh: the modes that need no exact surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.deformation import Deformation
from ffdcli.formats import Subdivision
from ffdcli.mesh import CheckedMesh
from ffdcli.mesh.charts import find_charts
from ffdcli.mesh.triangle_net import net_of_triangles
from ffdcli.tessellate.refine import RefinedNet, deform_net, refine_adaptively, refine_uniformly
from ffdcli.tessellate.texture import carry, texture_of


@dataclass(frozen=True)
class Subdivided:
    """A mesh, subdivided and deformed.

    Triangles (T, 3) of the refined net are counter-clockwise from outside after the deformation.
    Each has a polygon (T,) of the mesh and, if kept, texture coordinates of its corners (T, 3, 2).
    """

    refined: RefinedNet
    triangles: Ints
    polygon: Ints
    uv: Floats | None


def subdivide_mesh(
    checked: CheckedMesh,
    deformation: Deformation,
    mode: Subdivision,
    tolerance: float | None,
    levels: int | None = None,
    *,
    keep_texture: bool = False,
) -> Subdivided:
    """Subdivide the triangles of a mesh in one of the modes, and deform them.

    Parameters
    ----------
    tolerance : float or None, model length
        Tolerance of `uniform` and `adaptive`.
    levels : int or None
        Number of subdivisions for `uniform`, instead of a tolerance.
    keep_texture : bool
        Divide the mesh so that each triangle lies in one texture chart.
    """
    mesh, polygon, corners = checked.mesh, checked.polygon, checked.triangles
    piece, of_piece, texture = polygon, np.arange(mesh.polygon_count), None
    if keep_texture and mesh.uv is not None:
        uv = mesh.uv[checked.corner]
        piece = find_charts(mesh.vertices, corners, uv, polygon)
        of_piece = polygon[np.unique(piece, return_index=True)[1]]
        texture = texture_of(np.repeat(piece, 3), corners.ravel(), uv.reshape(-1, 2))
    net = net_of_triangles(mesh.vertices, corners, piece)
    if mode == "vertices":
        done = deform_net(net, deformation)
    elif mode == "uniform":
        done = refine_uniformly(net, deformation, tolerance, levels)
    elif tolerance is None:
        raise ValueError("adaptive subdivision needs a tolerance")
    else:
        done = refine_adaptively(net, deformation, tolerance)
    owner = of_piece[done.net.owner]
    body = checked.soundness.nesting.body
    mirrored = mirrored_bodies(mesh.vertices[corners], body[polygon], deformation)
    turned = mirrored[body[owner]][:, None]
    facing = np.where(turned, done.net.triangles[:, ::-1], done.net.triangles)
    kept = None if texture is None else carry(texture, done.net, facing)
    return Subdivided(done, facing, owner, kept)


def mirrored_bodies(corners: Floats, body: Ints, deformation: Deformation) -> Bools:
    """Bodies (B,) that the deformation turns inside out: det J < 0 at most moved triangles.

    Undeformed triangles have corners (T, 3, 3), model length, and a body (T,) each.
    """
    slopes = deformation.jacobian(corners.mean(axis=1))
    moved = (slopes != np.eye(3)).any(axis=(1, 2))
    senses = np.where(moved, np.sign(np.linalg.det(slopes)), 0.0)
    return np.asarray(np.bincount(body, weights=senses) < 0)
