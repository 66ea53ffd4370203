"""Make the sample meshes again: `python samples/make_samples.py [FOLDER]`.

Every shape is our own, so the samples carry the licence of the project. The same numbers come out
on every run; coordinates are rounded to 1e-12 mm, so that they do not depend on the
last bits of a cosine.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import cadquery as cq
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Field = Callable[[Floats], Floats]


def make_bracket() -> tuple[Floats, Ints]:
    """An L-bracket of 6 mm sheet, 90 x 40 x 60 mm: filleted, two holes and a slot in each leg."""
    profile = cq.Workplane("XZ").polyline([(0, 0), (90, 0), (90, 6), (6, 6), (6, 60), (0, 60)])
    body = profile.close().extrude(20, both=True)
    body = body.edges(cq.selectors.BoxSelector((5, -25, 5), (7, 25, 7))).fillet(8)
    body = body.edges("|Z and >X").fillet(12)
    body = body.edges("|X and >Z").fillet(12)
    top = body.faces("<Z").workplane(origin=(0, 0, 0))
    body = top.pushPoints([(76, 9), (76, -9)]).hole(7)
    body = body.faces("<Z").workplane(origin=(0, 0, 0)).center(46, 0).slot2D(32, 9).cutThruAll()
    back = body.faces("<X").workplane(origin=(0, 0, 0))
    body = back.pushPoints([(-9, 48), (9, 48)]).hole(7)
    body = body.faces("<X").workplane(origin=(0, 0, 0)).center(0, 31).hole(14)
    points, triangles = body.val().tessellate(0.05, 0.3)
    return np.array([p.toTuple() for p in points]), np.array(triangles)


def make_bottle(sides: int = 16) -> tuple[Floats, list[list[int]]]:
    """A faceted bottle, 70 mm wide and 190 mm high, with a wall and an open neck."""
    # Radius and height, up the outside and down the inside.
    outer_radii = [30, 34, 35, 35, 34, 31, 25, 18, 14, 13, 13, 15.5, 15.5, 13, 13]
    outer_heights = [0, 2, 6, 112, 121, 131, 141, 149, 157, 164, 174, 175, 180, 181, 190]
    inner_radii = [10.5, 10.5, 11.5, 15.5, 22.5, 28.5, 31.5, 32.5, 32.5, 31.5, 28]
    inner_heights = [190, 164, 157, 149, 140, 130, 120, 112, 8, 5, 4]
    radii, heights = outer_radii + inner_radii, outer_heights + inner_heights
    profile = np.stack([radii, heights], axis=1)
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = np.empty((len(profile), sides, 3))
    vertices[..., :2] = profile[:, None, :1] * ring
    vertices[..., 2] = profile[:, None, 1]
    index = np.arange(len(profile) * sides).reshape(-1, sides)
    following = np.roll(index, -1, axis=1)
    walls = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1)
    bottom, floor = index[0][::-1], index[-1]
    polygons = [*walls.reshape(-1, 4).tolist(), bottom.tolist(), floor.tolist()]
    return vertices.reshape(-1, 3), polygons


def make_handle(sides: int = 24) -> tuple[Floats, list[list[int]]]:
    """A straight handle of oval section, 28 x 20 mm and 240 mm long, with rounded ends."""
    turn = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    # A superellipse: fuller than an oval, without the corners of a rectangle.
    flat = 2 / 2.8
    across = 14 * np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** flat
    upward = 10 * np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** flat
    ends = np.array([(0, 0.55), (1.2, 0.8), (3.5, 0.94), (7, 1)])
    stations = np.concatenate([ends, (240 - ends[:, 0, None]) @ [[1, 0]] + ends[:, 1:] @ [[0, 1]]])
    stations = stations[np.argsort(stations[:, 0])]
    vertices = np.empty((len(stations), sides, 3))
    vertices[..., 0] = stations[:, None, 0]
    vertices[..., 1] = stations[:, None, 1] * across
    vertices[..., 2] = stations[:, None, 1] * upward
    index = np.arange(len(stations) * sides).reshape(-1, sides)
    following = np.roll(index, -1, axis=1)
    walls = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1)
    caps = [index[0][::-1].tolist(), index[-1].tolist()]
    return vertices.reshape(-1, 3), [*walls.reshape(-1, 4).tolist(), *caps]


def creature(points: Floats) -> Floats:
    """Signed distance, roughly, of points (..., 3) to a small four-legged animal, in mm."""
    # From, to, radius at either end: trunk, neck, head, snout, tail; then pairs of left and right.
    middle = [
        ((-24, 0, 34), (22, 0, 36), 15, 14),
        ((24, 0, 38), (38, 0, 56), 11, 9),
        ((38, 0, 60), (44, 0, 60), 13, 12),
        ((46, 0, 57), (62, 0, 53), 9, 6),
        ((-34, 0, 40), (-56, 0, 52), 7, 6),
    ]
    paired = [
        ((20, 9, 30), (22, 12, 6), 8.5, 6.5),
        ((-24, 9, 30), (-26, 12, 6), 9.5, 6.5),
        ((35, 8, 69), (32, 14, 80), 6.5, 5.5),
    ]
    parts = [*middle, *paired, *[((*a,), (*b,), r, s) for a, b, r, s in _mirrored(paired)]]
    distances = np.stack([cone_distance(points, *part) for part in parts])
    # A smooth minimum: parts flow into one another over about 3 mm.
    blend = 3.0
    nearest = distances.min(axis=0)
    return nearest - blend * np.log(np.exp((nearest - distances) / blend).sum(axis=0))


def _mirrored(parts: list) -> list:
    return [((a[0], -a[1], a[2]), (b[0], -b[1], b[2]), r, s) for a, b, r, s in parts]


def cone_distance(points: Floats, start: tuple, end: tuple, first: float, last: float) -> Floats:
    """Distance to a rod whose radius runs from ``first`` to ``last``."""
    origin, along = np.array(start, float), np.subtract(end, start).astype(float)
    share = np.clip((points - origin) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - origin - share[..., None] * along, axis=-1) - (
        first + share * (last - first)
    )


def surface_net(field: Field, low: Floats, high: Floats, step: float) -> tuple[Floats, Ints]:
    """A closed triangle mesh of ``field = 0``: one vertex per grid cell that it passes through."""
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    inside = field(grid) < 0
    shape = tuple(n - 1 for n in inside.shape)
    corners = np.stack(
        [
            inside[i : i + shape[0], j : j + shape[1], k : k + shape[2]]
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ]
    )
    crossed = corners.any(axis=0) & ~corners.all(axis=0)
    number = np.full(shape, -1)
    number[crossed] = np.arange(np.count_nonzero(crossed))
    vertices = grid[:-1, :-1, :-1][crossed] + step / 2
    quads = []
    for axis in range(3):
        # A grid edge along the axis that changes sides is shared by four cells: one quad.
        first = np.moveaxis(inside, axis, 0)
        cells = np.moveaxis(number, axis, 0)
        cut = first[:-1, 1:-1, 1:-1] != first[1:, 1:-1, 1:-1]
        outward = first[:-1, 1:-1, 1:-1][cut]
        near, far = cells[:, :-1], cells[:, 1:]
        ring = (near[..., :-1], far[..., :-1], far[..., 1:], near[..., 1:])
        around = np.stack([corner[cut] for corner in ring], axis=-1)
        flip = outward if axis != 1 else ~outward
        quads.append(np.where(flip[:, None], around, around[:, ::-1]))
    faces = np.concatenate(quads)
    vertices = _relax(field, vertices, faces, step)
    return vertices, _split(vertices, faces)


def _relax(field: Field, vertices: Floats, faces: Ints, step: float) -> Floats:
    """Even out the vertices, and put them on the surface by Newton steps."""
    sides = np.concatenate([faces, np.roll(faces, -1, axis=1)]).reshape(2, -1)
    ends = np.concatenate([sides, sides[::-1]], axis=1)
    count = np.bincount(ends[0], minlength=len(vertices))[:, None]
    for _ in range(12):
        mean = np.zeros_like(vertices)
        np.add.at(mean, ends[0], vertices[ends[1]])
        vertices = (vertices + mean / count) / 2
        for _ in range(2):
            shift = 1e-4 * step * np.eye(3)
            slope = np.stack(
                [(field(vertices + s) - field(vertices - s)) / (2e-4 * step) for s in shift], -1
            )
            vertices = vertices - (field(vertices) / (slope**2).sum(-1))[:, None] * slope
    return vertices


def _split(vertices: Floats, quads: Ints) -> Ints:
    """Triangles of quads, along the shorter diagonal."""
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    first = ((a - c) ** 2).sum(1) <= ((b - d) ** 2).sum(1)
    one = np.where(first[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    two = np.where(first[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.concatenate([one, two])


def write_obj(path: Path, title: str, vertices: Floats, polygons: list[list[int]]) -> None:
    """Wavefront OBJ, polygons kept."""
    rows = np.round(vertices, 12) + 0.0
    lines = [f"# {title}. Made by samples/make_samples.py; unit mm."]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in rows.tolist()]
    lines += ["f " + " ".join(str(corner + 1) for corner in polygon) for polygon in polygons]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def write_ply(path: Path, title: str, vertices: Floats, triangles: Ints) -> None:
    """Binary PLY in single precision, as scanners write it."""
    header = ["ply", "format binary_little_endian 1.0", f"comment {title}; unit mm"]
    header += [f"element vertex {len(vertices)}", *(f"property float {axis}" for axis in "xyz")]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    rounded = np.round(vertices, 4).astype("<f4")
    text = "\n".join([*header, "end_header"]) + "\n"
    path.write_bytes(text.encode("ascii") + rounded.tobytes() + faces.tobytes())


def main(folder: Path) -> None:
    """Write all sample meshes."""
    points, triangles = make_bracket()
    write_obj(folder / "bracket.obj", "L-bracket", points, triangles.tolist())
    write_obj(folder / "bottle.obj", "Bottle", *make_bottle())
    write_obj(folder / "handle.obj", "Handle", *make_handle())
    low, high = np.array([-66.0, -30.0, -6.0]), np.array([76.0, 30.0, 93.0])
    write_ply(folder / "creature.ply", "Creature", *surface_net(creature, low, high, 5.0))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
