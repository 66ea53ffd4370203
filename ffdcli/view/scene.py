"""What a picture shows, as plain arrays: the model before and after, lattice, drags, octree cells.

A scene knows neither VTK nor web pages; whatever draws it needs nothing else.
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
        Vertices at each amplitude of the scene. Faces share no vertices, so that shading may break
        between them.
    triangles : (T, 3) int64
    face : (T,) int64
        Face that each triangle is part of.
    outline : (m, 2) int64
        Vertices of the segments that bound faces.
    """

    frames: Floats
    triangles: Ints
    face: Ints
    outline: Ints


@dataclass(frozen=True)
class Net:
    """Control points and the lines between neighbours.

    Parameters
    ----------
    frames : (S, n, 3) float64, model length
    lines : (m, 2) int64
    locked : (n,) bool
        Control points that the join with what is outside the box holds in place.
    """

    frames: Floats
    lines: Ints
    locked: Bools


@dataclass(frozen=True)
class Faces:
    """Facts about the faces of the result, for colours and for who points at one.

    Parameters
    ----------
    degrees : tuple of str
        Of each face, such as ``3x6`` or ``plane``.
    deviation : (F,) float64, model length, or None
        Largest distance found between the face and the deformation of the mesh.
    colour : (F,) int64
        Number of a colour, another one for each neighbour where there are enough.
    """

    degrees: tuple[str, ...]
    deviation: Floats | None
    colour: Ints


@dataclass(frozen=True)
class Scene:
    """One model in one lattice, or a CAD model alone.

    Parameters
    ----------
    title : str
    facts : str
        One line on what the result is.
    unit : str
    amplitudes : (S,) float64
        Rising from 0 (rest) to 1; of a CAD model alone just 1.
    before : Skin or None
        The mesh; its faces are its polygons.
    after : Skin
        The exact surfaces.
    faces : Faces
    lattices : tuple of Net
    drags : (k, 2, 3) float64, model length
        From and to of every drag.
    cells : (m, 2, 3) float64, model length
        Edges of the octree's cells.
    """

    title: str
    facts: str
    unit: str
    amplitudes: Floats
    before: Skin | None
    after: Skin
    faces: Faces
    lattices: tuple[Net, ...]
    drags: Floats
    cells: Floats

    @property
    def bounds(self) -> Floats:
        """(2, 3) corners of a box around everything, model length."""
        parts = [self.after.frames.reshape(-1, 3), self.drags.reshape(-1, 3)]
        parts += [net.frames.reshape(-1, 3) for net in self.lattices]
        parts += [] if self.before is None else [self.before.frames.reshape(-1, 3)]
        points = np.concatenate([*parts, self.cells.reshape(-1, 3)])
        return np.stack([points.min(axis=0), points.max(axis=0)])


def skin(frames: Floats, triangles: Ints, face: Ints) -> Skin:
    """Make a skin of a conforming triangulation.

    Parameters
    ----------
    frames : (S, n, 3) float64
    triangles : (T, 3) int64
        Two triangles are neighbours where they share two vertices.
    face : (T,) int64
    """
    count = frames.shape[1]
    sides = _meeting_sides(triangles, count)
    inner = face[sides[:, 0] // 3] == face[sides[:, 1] // 3]
    # A side bounds its face unless the face has another triangle on it; two faces draw it once.
    bounding = np.ones(triangles.size, dtype=bool)
    bounding[sides[inner]] = False
    bounding[sides[~inner, 1]] = False
    pair = np.repeat(face, 3) * count + triangles.ravel()
    own, corner = np.unique(pair, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = np.stack([corner.ravel(), np.roll(corner, -1, axis=1).ravel()], axis=1)
    return Skin(frames[:, own % count], corner, face, ends[bounding])


def colour_faces(triangles: Ints, face: Ints, count: int) -> Ints:
    """(F,) colour number of each face, never that of a neighbour.

    Parameters
    ----------
    triangles : (T, 3) int64
        Conforming; faces share vertices.
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
    """(m, 2) neighbours in a net of control points, by their number."""
    number = np.arange(np.prod(shape)).reshape(shape)
    pairs = []
    for axis in range(3):
        along = np.moveaxis(number, axis, 0)
        pairs.append(np.stack([along[:-1].ravel(), along[1:].ravel()], axis=1))
    return np.concatenate(pairs)


def _meeting_sides(triangles: Ints, count: int) -> Ints:
    """(m, 2) sides, 3 t + i for the one from corner i of triangle t, that run along one edge."""
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    key = edge_keys(tails, heads, count)
    order = np.argsort(key, kind="stable")
    meet = np.flatnonzero(key[order][1:] == key[order][:-1])
    return np.stack([order[meet], order[meet + 1]], axis=1)
