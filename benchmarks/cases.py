"""Meshes and lattices that the benchmarks use, written as files."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

LATTICE = Path(__file__).parent / "bench-icosphere-6x6x6.yaml"
BOX = np.array([100.0, 60.0, 40.0])
# A turn that leaves no axis where it was.
TURN = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3


def geodesic_sphere(frequency: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of an icosahedron, each side cut in ``frequency``: 20 f² facets."""
    from trimesh.creation import icosahedron

    base = icosahedron()
    steps = [
        (i, j, frequency - i - j) for i in range(frequency + 1) for j in range(frequency + 1 - i)
    ]
    place = {step: number for number, step in enumerate(steps)}
    inner = []
    for i, j, k in steps:
        if k:
            inner.append([place[i, j, k], place[i + 1, j, k - 1], place[i, j + 1, k - 1]])
        if k and j:
            inner.append([place[i, j, k], place[i + 1, j - 1, k], place[i + 1, j, k - 1]])
    weights = np.array(steps) / frequency
    points = np.einsum("sk,fkd->fsd", weights, base.vertices[base.faces]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    triangles = np.array(inner)[None] + (np.arange(20) * len(steps))[:, None, None]
    # Points on common sides are the same to a rounding.
    _, first, number = np.unique(
        np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[triangles.reshape(-1, 3)]


def box_mesh() -> tuple[np.ndarray, np.ndarray]:
    """A box as 12 triangles."""
    from trimesh.creation import box

    mesh = box(extents=BOX)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def prism(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """An extruded, slightly irregular polygon of so many triangles (even, from 8 on)."""
    sides, more = divmod(triangles + 4, 4)
    angle = 2 * np.pi * np.arange(sides) / sides
    radius = 1 + 0.25 * np.cos(3 * angle)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    bottom = np.column_stack([ring, np.zeros(sides)])
    points = np.concatenate([bottom, bottom + np.array([0, 0, 0.6])])
    number = np.arange(sides)
    after = np.roll(number, -1)
    walls = [
        np.column_stack([number, after, after + sides]),
        np.column_stack([number, after + sides, number + sides]),
    ]
    fan = np.column_stack([np.zeros(sides - 2, int), number[1:-1], number[2:]])
    faces = np.concatenate([*walls, fan[:, ::-1], fan + sides])
    if more:
        # Two more: the last triangle cut in three.
        a, b, c = faces[-1]
        points = np.concatenate([points, points[[a, b, c]].mean(axis=0, keepdims=True)])
        middle = len(points) - 1
        faces = np.concatenate([faces[:-1], [[a, b, middle], [b, c, middle], [c, a, middle]]])
    return points, faces


def write_obj(path: Path, points: np.ndarray, faces: np.ndarray) -> Path:
    """Write every digit."""
    lines = ["v {!r} {!r} {!r}".format(*point) for point in points.tolist()]
    lines += ["f {} {} {}".format(*(face + 1)) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_lattice(path: Path, degree: list[int], points: list[int], size: np.ndarray) -> Path:
    """A lattice whose control points are all moved at random, by up to 2 % of the size."""
    random = np.random.default_rng(2002)
    shift = 0.02 * np.linalg.norm(size) * random.uniform(-1, 1, size=(*points, 3))
    lines = ["version: 1", f"degree: {degree}", f"points: {points}", "edits:"]
    lines += [
        f"- move: {{at: {list(index)}, by: {shift[index].tolist()}}}"
        for index in np.ndindex(*points)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def scan_files(folder: Path, frequency: int) -> tuple[Path, Path]:
    """A closed mesh as a scanner gives it, 20 f² facets, and a lattice of degree 2.

    A blob with bumps of several sizes; vertices are displaced at random along it and across, by
    shares of a side, so that no two facets are coplanar. Binary STL in single precision.
    """
    import trimesh

    random = np.random.default_rng(21)
    points, faces = geodesic_sphere(frequency)
    side = 1.2 / frequency
    points = points + 0.2 * side * random.uniform(-1, 1, size=points.shape)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    height = np.ones(len(points))
    for waves, amplitude in ((3, 0.1), (9, 0.03), (27, 0.01)):
        ways = random.normal(size=(6, 3))
        height += amplitude * np.sin(waves * points @ ways.T).mean(axis=1)
    height += 0.02 * side * random.uniform(-1, 1, size=len(points))
    path = folder / f"scan-{len(faces)}.stl"
    trimesh.Trimesh(100 * points * height[:, None], faces, process=False).export(path)
    lattice = write_lattice(folder / "scan.yaml", [2, 2, 2], [8, 8, 8], np.full(3, 200.0))
    return path, lattice


def sphere_files(folder: Path, frequency: int) -> tuple[Path, Path]:
    """The mesh and lattice of most rows."""
    mesh = write_obj(folder / f"sphere-{20 * frequency**2}.obj", *geodesic_sphere(frequency))
    return mesh, Path(shutil.copy(LATTICE, folder))
