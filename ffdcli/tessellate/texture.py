"""Transfer texture coordinates from a mesh to nets that refine it.

Within one flat piece each vertex has one pair of texture coordinates, so they are stored by piece
and vertex. A new vertex is the midpoint of two old ones, and so are its texture coordinates. If
neighbouring pieces agree at the ends of an edge, they agree bit by bit along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.geometry import Geometry
from ffdcli.mesh import CheckedMesh, Mesh
from ffdcli.mesh.triangle_net import TriangleNet

# Rounding difference between the coordinates of one vertex in two pieces.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Texture:
    """Texture coordinates (n, 2) of vertices (n,) in pieces (n,), the owners; NaN for none.

    Each pair of a piece and a vertex occurs once.
    """

    owner: Ints
    vertex: Ints
    uv: Floats


def texture_of(owner: Ints, vertex: Ints, uv: Floats) -> Texture:
    """Texture of coordinates (n, 2) of vertices in pieces; the first of each pair counts."""
    pairs, first = np.unique(np.column_stack([owner, vertex]), axis=0, return_index=True)
    return Texture(pairs[:, 0], pairs[:, 1], uv[first])


def face_texture(checked: CheckedMesh, geometry: Geometry) -> Texture:
    """Texture coordinates of a B-rep's vertices in its faces, each of which is in one chart.

    The geometry is that of faces that were cut from the triangles of the mesh.
    """
    mesh, corner = checked.mesh, checked.corner
    if mesh.uv is None:
        raise ValueError("the mesh has no texture coordinates")
    pieces = geometry.parts.pieces
    number = geometry.vertices.number
    # Only vertices on outlines are vertices of the B-rep.
    kept = np.flatnonzero(number[pieces.corners] >= 0)
    vertex = pieces.corners[kept]
    triangle = pieces.triangle[pieces.owner[kept]]
    around = mesh.corners[corner[triangle]]
    own = around == vertex[:, None]
    share = _shares(mesh.vertices[around], geometry.vertices.rest[number[vertex]])
    share = np.where(own.any(axis=1)[:, None], own, share)
    # NaN at corners with weight 0 must not count.
    with np.errstate(invalid="ignore"):
        uv = np.where(share[:, :, None] > 0, share[:, :, None] * mesh.uv[corner[triangle]], 0.0)
    face = geometry.parts.region[pieces.owner[kept]]
    texture = texture_of(face, number[vertex], uv.sum(axis=1))
    return Texture(texture.owner, texture.vertex, _joined(texture))


def _shares(corners: Floats, at: Floats) -> Floats:
    """Barycentric coordinates (n, 3) of points (n, 3) in triangles (n, 3, 3)."""
    a, b, c = (corners[:, n] for n in range(3))
    normal = np.cross(b - a, c - a)
    parts = [np.cross(q - p, at - p) for p, q in ((b, c), (c, a), (a, b))]
    share = np.stack([np.einsum("ni,ni->n", part, normal) for part in parts], axis=1)
    share = np.maximum(share, 0.0)
    total = share.sum(axis=1)
    # Triangles without area: use the first corner.
    share[total == 0] = (1.0, 0.0, 0.0)
    return np.asarray(share / share.sum(axis=1, keepdims=True))


def _joined(texture: Texture) -> Floats:
    """Texture coordinates, made bit-equal where they differ by rounding only."""
    uv = texture.uv.copy()
    left = np.flatnonzero(~np.isnan(uv[:, 0]))
    while len(left):
        _, first, group = np.unique(texture.vertex[left], return_index=True, return_inverse=True)
        leader = uv[left[first]][group]
        near = (np.abs(uv[left] - leader) <= _ROUNDING * np.maximum(1.0, np.abs(leader))).all(
            axis=1
        )
        uv[left[near]] = leader[near]
        left = left[~near]
    return uv


def carry(texture: Texture, net: TriangleNet, triangles: Ints) -> Floats:
    """(T, 3, 2) texture coordinates of the corners of a net refined from one with a texture.

    The texture is that of the first vertices of the net, whose owners are its pieces. The triangles
    (T, 3) are those of the net, in either orientation.
    """
    count = len(net.rest)
    first = count - len(net.parents)
    owner = np.repeat(net.owner, 3)
    keys, place = np.unique(owner * count + triangles.ravel(), return_inverse=True)
    piece, vertex = np.divmod(keys, count)
    uv = np.full((len(keys), 2), np.nan)
    old = vertex < first
    known = texture.owner * count + texture.vertex
    uv[old] = texture.uv[_find(keys[old], known)]
    # Vertices are numbered by round: parents come before children.
    new = np.flatnonzero(~old)
    parents = net.parents[vertex[new] - first]
    rows = _find(piece[new, None] * count + parents, keys)
    done = old.copy()
    while len(new):
        ready = done[rows].all(axis=1)
        uv[new[ready]] = (uv[rows[ready, 0]] + uv[rows[ready, 1]]) / 2
        done[new[ready]] = True
        new, rows = new[~ready], rows[~ready]
    return np.asarray(uv[place].reshape(-1, 3, 2))


def _find(keys: Ints, known: Ints) -> Ints:
    """Positions of keys among sorted known ones."""
    rows = np.minimum(np.searchsorted(known, keys), len(known) - 1)
    if (known[rows] != keys).any():
        raise ValueError("a vertex of the net has no place in the texture")
    return rows


def lost_texture(mesh: Mesh, texture: Texture | None) -> list[str]:
    """What to tell users whose mesh has texture coordinates that faces do not keep."""
    if mesh.uv is None or texture is not None:
        return []
    return [
        "texture coordinates are left out: faces may join polygons that have different ones;"
        " deform_mesh keeps these apart"
    ]
