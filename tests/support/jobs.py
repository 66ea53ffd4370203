"""Meshes and lattices as a user has them, in files that are read back."""

import itertools

import numpy as np
import trimesh

from ffdcli import read_lattice, read_mesh
from ffdcli.verify.file import allowed_deviation, verify_file

CUBE = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
EDITS = """
edits:
  - move: {at: [0, 0, 0], by: [-0.2, 0.1, 0.05]}
  - move: {at: [-1, 1, 2], by: [0.1, -0.05, 0.2]}
  - twist: {axis: w, angle: 30}
"""


def turn(angles):
    """Rotation matrix about x, then y, then z."""
    result = np.eye(3)
    for axis, angle in enumerate(angles):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[i, i] = step[j, j] = np.cos(angle)
        step[j, i], step[i, j] = np.sin(angle), -np.sin(angle)
        result = step @ result
    return result


def obj(points, faces):
    """Text of an OBJ file, every digit kept."""
    lines = ["v " + " ".join(map(str, point)) for point in points]
    lines += ["f " + " ".join(str(vertex + 1) for vertex in face) for face in faces]
    return "\n".join(lines) + "\n"


def read_job(folder, lattice, points=CUBE, faces=CUBE_FACES, *, mesh=None):
    """Write a mesh and a lattice file and read them back.

    ``mesh`` is text of an OBJ file, in place of points and faces; `version: 1` goes before what
    ``lattice`` says.
    """
    (folder / "mesh.obj").write_text(obj(points, faces) if mesh is None else mesh)
    (folder / "lattice.yaml").write_text(f"version: 1\n{lattice}")
    record = read_mesh(folder / "mesh.obj")
    return record, read_lattice(folder / "lattice.yaml", record)


def ellipsoid(folder, subdivisions):
    """A mesh with half axes 10, 7 and 5, from a file."""
    ball = trimesh.creation.icosphere(subdivisions, 10.0)
    ball.apply_scale([1.0, 0.7, 0.5])
    ball.export(folder / "ball.obj")
    return read_mesh(folder / "ball.obj")


def written(result, path, mesh, lattice):
    """Write, re-read, verify to rounding; the verdict."""
    result.write(path)
    allowed = allowed_deviation(result.report, "report", mesh)
    verdict = verify_file(path, mesh, lattice, tolerance=allowed)
    assert verdict.passed, verdict.reasons
    return verdict
