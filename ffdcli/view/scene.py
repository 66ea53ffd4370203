"""Scenes: model before and after, lattices, drags and octree cells, for pages and panels.

Pictures and web pages are made from a scene alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import edge_keys


@dataclass(frozen=True)
class Skin:
    """A surface in triangles, at one or more amplitudes of the deformation.

    Parameters
    ----------
    frames : (S, n, 3) float64, model length
        Vertices at each amplitude of the scene. Faces share no vertices, so that edges between them
        are shaded sharp.
    triangles : (T, 3) int64
    face : (T,) int64
        Face of each triangle.
    outline : (m, 2) int64
        Vertices of the segments on the boundaries of faces.
    """

    frames: Floats
    triangles: Ints
    face: Ints
    outline: Ints


@dataclass(frozen=True)
class DrawnNet:
    """Control points and the lines between neighbours.

    Parameters
    ----------
    frames : (S, n, 3) float64, model length
    lines : (m, 2) int64
    locked : (n,) bool
        Control points that are fixed by the continuity at the sides of the box.
    hidden : (n,) bool
        Control points of an octree's empty cells, which are drawn on request only.
    """

    frames: Floats
    lines: Ints
    locked: Bools
    hidden: Bools


@dataclass(frozen=True)
class Faces:
    """Facts about the faces of the result.

    Parameters
    ----------
    degrees : tuple of str
        Degrees of each face, such as ``3x6`` or ``plane``.
    deviation : (F,) float64, model length, or None
        Largest distance found between each face and the deformed mesh.
    colour : (F,) int64
        Number of a colour for each face; neighbours have different numbers.
    """

    degrees: tuple[str, ...]
    deviation: Floats | None
    colour: Ints


@dataclass(frozen=True)
class Scene:
    """A model and its lattices, or a CAD model alone.

    Parameters
    ----------
    title : str
    facts : str
        One line that describes the result.
    unit : str
    amplitudes : (S,) float64
        Amplitudes from 0 (rest) to 1; of a CAD model 1 only.
    before : Skin or None
        The mesh, with its polygons as faces.
    after : Skin
        The exact surfaces.
    faces : Faces
    lattices : tuple of DrawnNet
    drags : (k, 2, 3) float64, model length
        Start and end of each drag.
    cells : (m, 2, 3) float64, model length
        Edges of the octree cells.
    hidden_points : bool
        Whether hidden control points are drawn. A page can change that.
    """

    title: str
    facts: str
    unit: str
    amplitudes: Floats
    before: Skin | None
    after: Skin
    faces: Faces
    lattices: tuple[DrawnNet, ...]
    drags: Floats
    cells: Floats
    hidden_points: bool

    @property
    def hidden_count(self) -> int:
        """Number of hidden control points, whether they are drawn or not."""
        return sum(int(net.hidden.sum()) for net in self.lattices)

    def bounds(self, *, hidden_points: bool) -> Floats:
        """Lowest and highest coordinates (2, 3) of the contents, model length.

        With hidden control points or without.
        """
        parts = [self.after.frames.reshape(-1, 3), self.drags.reshape(-1, 3)]
        parts += [
            net.frames[:, hidden_points | ~net.hidden].reshape(-1, 3) for net in self.lattices
        ]
        parts += [] if self.before is None else [self.before.frames.reshape(-1, 3)]
        points = np.concatenate([*parts, self.cells.reshape(-1, 3)])
        return np.stack([points.min(axis=0), points.max(axis=0)])


def skin(frames: Floats, triangles: Ints, face: Ints) -> Skin:
    """Skin of a conforming triangulation.

    Parameters
    ----------
    frames : (S, n, 3) float64
    triangles : (T, 3) int64
        Two triangles are neighbours if they share two vertices.
    face : (T,) int64
    """
    count = frames.shape[1]
    sides = _meeting_sides(triangles, count)
    inner = face[sides[:, 0] // 3] == face[sides[:, 1] // 3]
    # A side is on the outline unless both its triangles belong to one face; it is drawn once.
    bounding = np.ones(triangles.size, dtype=bool)
    bounding[sides[inner]] = False
    bounding[sides[~inner, 1]] = False
    pair = np.repeat(face, 3) * count + triangles.ravel()
    own, corner = np.unique(pair, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = np.stack([corner.ravel(), np.roll(corner, -1, axis=1).ravel()], axis=1)
    return Skin(frames[:, own % count], corner, face, ends[bounding])


def colour_faces(triangles: Ints, face: Ints, count: int) -> Ints:
    """Colour numbers of all faces, (F,); neighbours have different ones.

    Parameters
    ----------
    triangles : (T, 3) int64
        Conforming, with vertices shared between faces.
    face : (T,) int64
    count : int
        Number of faces.
    """
    import networkx

    sides = _meeting_sides(triangles, int(triangles.max(initial=-1)) + 1)
    graph = networkx.Graph()
    graph.add_nodes_from(range(count))
    meeting = face[sides // 3]
    graph.add_edges_from(meeting[meeting[:, 0] != meeting[:, 1]].tolist())
    given = networkx.greedy_color(graph, strategy="smallest_last")
    return np.array([given[number] for number in range(count)], dtype=np.int64)


def grid_lines(shape: tuple[int, int, int]) -> Ints:
    """Pairs of neighbours in a net of control points, (m, 2), by their numbers."""
    number = np.arange(np.prod(shape)).reshape(shape)
    pairs = []
    for axis in range(3):
        along = np.moveaxis(number, axis, 0)
        pairs.append(np.stack([along[:-1].ravel(), along[1:].ravel()], axis=1))
    return np.concatenate(pairs)


def _meeting_sides(triangles: Ints, count: int) -> Ints:
    """Pairs of sides along one edge, (m, 2); side 3 t + i starts at corner i of triangle t."""
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    key = edge_keys(tails, heads, count)
    order = np.argsort(key, kind="stable")
    meet = np.flatnonzero(key[order][1:] == key[order][:-1])
    return np.stack([order[meet], order[meet + 1]], axis=1)
