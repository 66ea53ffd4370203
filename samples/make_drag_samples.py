"""Make the samples of dragging again: `python samples/make_drag_samples.py [FOLDER]`.

They follow the examples of Hu et al. 2001: a bottle from four drags, a cylinder made into a cup by
many, a fish stretched by four with three lattices, ears pulled with a lattice round part of the
head; and a flange that moves as one. Bottle and head are meshes of the other samples.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Polygons = list[list[int]]

# Half width, half height and place along y of a fish's sections, from mouth to tail, in mm.
FISH = [
    (3, 3, 0),
    (8, 9, 6),
    (13, 17, 18),
    (16, 24, 36),
    (17, 28, 58),
    (15, 27, 82),
    (11, 21, 106),
    (7, 13, 128),
    (4, 8, 144),
    (2.5, 12, 156),
    (2, 22, 168),
    (1.5, 30, 178),
]

CUP_HEIGHTS = [0, 14, 28, 42, 56, 70, 84]
# Radius of the cup at these heights: a foot, a stem, a bowl with a flared lip.
CUP_RADII = [34, 26, 22, 27, 36, 41, 46]
CYLINDER_RADIUS = 30


def loft(rings: Floats) -> tuple[Floats, Polygons]:
    """A closed solid through rings (s, n, 3), its ends closed by polygons."""
    index = np.arange(rings.shape[0] * rings.shape[1]).reshape(rings.shape[:2])
    following = np.roll(index, -1, axis=1)
    walls = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1)
    ends = [index[0][::-1].tolist(), index[-1].tolist()]
    return rings.reshape(-1, 3), [*walls.reshape(-1, 4).tolist(), *ends]


def turned(profile: list[tuple[float, float]], sides: int) -> Floats:
    """Rings (s, n, 3) of a profile of radius and height, turned about z."""
    turn = 2 * np.pi * np.arange(sides) / sides
    outline = np.array(profile)
    rings = np.empty((len(profile), sides, 3))
    rings[..., 0] = outline[:, :1] * np.cos(turn)
    rings[..., 1] = outline[:, :1] * np.sin(turn)
    rings[..., 2] = outline[:, 1:]
    return rings


def make_cylinder(sides: int = 16) -> tuple[Floats, Polygons]:
    """A hollow cylinder with a floor, 60 mm wide and 84 mm high."""
    return loft(turned([(30, 0), (30, 84), (26, 84), (26, 6)], sides))


def make_fish(sides: int = 12) -> tuple[Floats, Polygons]:
    """A fish-like body, 178 mm long, of oval sections; its tail is a flat fin."""
    turn = 2 * np.pi * np.arange(sides) / sides
    sections = np.array(FISH)
    rings = np.empty((len(FISH), sides, 3))
    rings[..., 0] = sections[:, :1] * np.cos(turn)
    rings[..., 1] = sections[:, 2:]
    rings[..., 2] = sections[:, 1:2] * -np.sin(turn)
    vertices, polygons = loft(rings)
    # The sides twist a little, so that quadrilaterals would not be flat.
    halves = [[q[:3], [q[0], *q[2:]]] if len(q) == 4 else [q] for q in polygons]
    return vertices, [half for both in halves for half in both]


def make_flange(sides: int = 16) -> tuple[Floats, Polygons]:
    """A pipe of 40 mm with a flange of 80 mm at its foot, 100 mm high, bored through."""
    rings = turned([(15, 0), (40, 0), (40, 8), (20, 8), (20, 100), (15, 100)], sides)
    index = np.arange(rings.shape[0] * sides).reshape(-1, sides)
    after, beside = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    walls = np.stack([index, beside, np.roll(after, -1, axis=1), after], axis=-1)
    return rings.reshape(-1, 3), walls.reshape(-1, 4).tolist()


def cup_pairs(around: int = 8) -> Floats:
    """Pairs (m, 6): points of the cylinder's outside, and where they are on the cup."""
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = []
    for height, radius in zip(CUP_HEIGHTS, CUP_RADII, strict=True):
        level = np.full((around, 1), float(height))
        rows.append(np.hstack([CYLINDER_RADIUS * ring, level, radius * ring, level]))
    return np.concatenate(rows)


def write_obj(path: Path, title: str, vertices: Floats, polygons: Polygons) -> None:
    """Wavefront OBJ, polygons kept."""
    rows = np.round(vertices, 12) + 0.0
    lines = [f"# {title}. Made by samples/make_drag_samples.py; unit mm."]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in rows.tolist()]
    lines += ["f " + " ".join(str(corner + 1) for corner in polygon) for polygon in polygons]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def main(folder: Path) -> None:
    """Write the meshes and the table of the cup's pairs."""
    folder.mkdir(parents=True, exist_ok=True)
    write_obj(folder / "cylinder.obj", "Hollow cylinder with a floor", *make_cylinder())
    write_obj(folder / "fish.obj", "Fish", *make_fish())
    write_obj(folder / "flange.obj", "Pipe with a flange", *make_flange())
    rows = np.round(cup_pairs(), 12) + 0.0
    lines = ["x,y,z,tx,ty,tz", *(",".join(map(repr, row)) for row in rows.tolist())]
    (folder / "cup.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "drags")
