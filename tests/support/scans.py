"""A body with dents, a deformation by formula, and scans of the deformed body."""

import numpy as np
import trimesh

SIZE = 5.1
NOISE = 0.01
# Root mean square length of normal noise in space.
IN_SPACE = NOISE * np.sqrt(3)


def body(fineness, turn=None):
    """Vertices and triangles; a turn of the sphere that they come from gives another mesh."""
    sphere = trimesh.creation.icosphere(subdivisions=fineness)
    x, y, z = unit = sphere.vertices.T if turn is None else (sphere.vertices @ turn).T
    radius = 1 + 0.15 * np.sin(4 * x) * np.cos(3 * y + 1) + 0.1 * np.sin(5 * z)
    return (unit * radius).T * [2, 1, 0.7], np.asarray(sphere.faces)


def deform(points):
    x, y, z = points.T
    moved = [x + 0.02 * np.sin(2 * y), y + 0.0125 * x**2 - 0.02 * z]
    return np.stack([*moved, z + 0.08 * np.sin(1.2 * x) + 0.03 * x * y], axis=1)


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
# The re-meshed body at rest; its scan has noise.
REST, FACES = body(4, TURN * np.linalg.det(TURN))
SCANNED = deform(REST) + np.random.default_rng(1).normal(0, NOISE, REST.shape)


def faces_of(kept):
    """Triangles all of whose vertices (n,) are kept."""
    return FACES[kept[FACES].all(axis=1)]


def write_mesh(file, points, faces):
    trimesh.Trimesh(points, faces, process=False).export(file)
    return file


def write_points(file, points):
    np.savetxt(file, points)
    return file
