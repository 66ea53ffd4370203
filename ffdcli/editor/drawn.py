"""The model as triangles, fine enough that a bent face is seen bent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh import Mesh, triangles
from ffdcli.mesh.triangle_net import TriangleNet, net_of_triangles
from ffdcli.part.record import Part
from ffdcli.tessellate.split import split
from ffdcli.view.colours import FACES
from ffdcli.view.scene import colour_faces, skin

# Vertices that faces are divided into at most, unless the model has more.
MOST_VERTICES = 60_000
# Length of an edge that is not halved, as a share of the size of the model.
EDGE = 1 / 48
# Faces that are coloured one by one; of a model of more, all triangles share their vertices.
MOST_COLOURED = 20_000


@dataclass(frozen=True, eq=False)
class Drawn:
    """Triangles of a model.

    Parameters
    ----------
    rest : (V, 3) float64, model length
        Vertices of the undeformed model.
    triangles : (T, 3) int64
    face : (T,) int64
        Face of each triangle.
    colours : (V, 3) uint8
        Red, green and blue of the face.
    outline : (k, 2) int64
        Vertices of the lines between faces.
    vertices : (V, 3) float64, model length
        Deformed vertices; of a drawing for previews the undeformed ones.
    """

    rest: Floats
    triangles: Ints
    face: Ints
    colours: np.ndarray[tuple[int, int], np.dtype[np.uint8]]
    outline: Ints
    vertices: Floats


def draw_model(model: Mesh | Part, mesh: Mesh) -> Drawn:
    """The triangles of a model, those of large faces divided.

    Parameters
    ----------
    model : Mesh or Part
    mesh : Mesh
        The mesh itself, or that of the part. Polygons of it that meet in one plane are a face.
    """
    if isinstance(model, Mesh):
        corners, _ = triangles(mesh)
        rest, face = mesh.vertices, flat_faces(mesh.vertices, corners)
    else:
        # Only parts need these libraries.
        from ffdcli.brep.occ.part.mesh import joined_triangles

        rest, corners, face, _ = joined_triangles(model)
    net = divided(net_of_triangles(rest, corners, face), EDGE * mesh.size, MOST_VERTICES)
    return coloured(net.rest, net.rest, net.triangles, net.owner)


def coloured(
    rest: Floats, vertices: Floats, corners: Ints, face: Ints, joined: Ints | None = None
) -> Drawn:
    """A drawing of triangles (T, 3) of faces (T,), which are coloured unless they are too many.

    Faces that are coloured share no vertices. ``joined`` (T, 3) are the triangles with common
    vertices of neighbouring faces, where the given ones have none.
    """
    names, face = np.unique(face, return_inverse=True)
    palette = np.array([[int(each[i : i + 2], 16) for i in (1, 3, 5)] for each in FACES])
    if len(names) > MOST_COLOURED:
        colours = np.broadcast_to(palette[0], rest.shape).astype(np.uint8)
        lines = np.zeros((0, 2), dtype=np.int64)
        return Drawn(rest, corners, face, colours, lines, vertices)
    number = colour_faces(corners if joined is None else joined, face, len(names))
    both = skin(np.stack([rest, vertices]), corners, face)
    of_vertex = np.zeros(both.frames.shape[1], dtype=np.int64)
    of_vertex[both.triangles] = number[face][:, None]
    colours = palette[of_vertex % len(palette)].astype(np.uint8)
    return Drawn(both.frames[0], both.triangles, face, colours, both.outline, both.frames[1])


def divided(net: TriangleNet, length: float, most: int) -> TriangleNet:
    """A net whose edges are halved until none is longer, or it has about ``most`` vertices."""
    while len(net.rest) < most:
        spans = np.linalg.norm(net.rest[net.ends[:, 0]] - net.rest[net.ends[:, 1]], axis=1)
        long = spans > length
        if not long.any():
            break
        room = most - len(net.rest)
        if long.sum() > room:
            # The longest ones first; each halved edge is one vertex more.
            long[np.argsort(-spans, kind="stable")[room:]] = False
        net, _ = split(net, long, net.rest)
    return net


def flat_faces(rest: Floats, corners: Ints) -> Ints:
    """Face (T,) of each triangle: those that meet at an edge in about one plane are one face."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    sides = rest[corners[:, 1:]] - rest[corners[:, :1]]
    normal = np.cross(sides[:, 0], sides[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    order = np.lexsort((high, low))
    meet = np.flatnonzero(
        (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    )
    first, second = order[meet] // 3, order[meet + 1] // 3
    flat = np.einsum("ij,ij->i", normal[first], normal[second]) > _FLAT
    pairs = (np.ones(flat.sum(), dtype=bool), (first[flat], second[flat]))
    count = len(corners)
    return np.asarray(
        connected_components(coo_array(pairs, shape=(count, count)), directed=False)[1],
        dtype=np.int64,
    )


# Cosine of the angle between triangles that count as one flat face: a hundredth of a degree.
_FLAT = 1 - 1.5e-8
