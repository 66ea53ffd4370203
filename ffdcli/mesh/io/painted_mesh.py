"""Triangles to be written to a mesh file, with groups, materials and texture coordinates."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints, pad_rows
from ffdcli.labels import Colour, Material

# Colour of a material without one, in formats that require a colour.
GREY: Colour = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class Paint:
    """Materials, and (T,) the position of each triangle's; -1 for none."""

    materials: tuple[Material, ...]
    material: Ints

    @property
    def names(self) -> list[str]:
        """A distinct name without spaces for each material."""
        words = [obj_word(each.name) for each in self.materials]
        return [w.replace(" ", "_") for w in distinct([word or "material" for word in words])]

    @property
    def coloured(self) -> bool:
        """Whether any material has a colour."""
        return any(each.colour is not None for each in self.materials)

    def face_colours(self) -> Ints:
        """(T, 4) red, green, blue and opacity, 0 to 255; grey for triangles without a colour."""
        table = [each.colour or GREY for each in self.materials] + [GREY]
        levels = np.round(255 * np.array(table)[self.material]).astype(np.uint8)
        return np.column_stack([levels, np.full(len(levels), 255, dtype=np.uint8)])


UNPAINTED = Paint((), np.zeros(0, dtype=np.int64))


@dataclass(frozen=True)
class PaintedMesh:
    """What an encoder takes; formats without a place for a part of it leave it out.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
        Written as they are.
    triangles : (T, 3) int64
    groups : mapping of str to (n,) int64
        Triangles of each named group.
    paint : Paint
    uv : (T, 3, 2) float64 or None
        Texture coordinates of the corners; NaN for triangles without them.
    name : str
        Name of the triangles that are in no group.
    unit : str
    """

    vertices: Floats
    triangles: Ints
    groups: Mapping[str, Ints] = field(default_factory=dict)
    paint: Paint = UNPAINTED
    uv: Floats | None = None
    name: str = "mesh"
    unit: str = "mm"

    @property
    def material(self) -> Ints:
        """(T,) position of each triangle's material; -1 for none."""
        return self.paint.material if self.paint.materials else np.full(len(self.triangles), -1)


@dataclass(frozen=True)
class EncodedMesh:
    """What an encoder returns: content, further files, and groups that the file does not name."""

    content: bytes
    beside: Mapping[Path, bytes] = field(default_factory=dict)
    unnamed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Parts:
    """Part (T,) of each triangle; groups and material of each part, -1 for none."""

    label: Ints
    names: list[list[str]]
    material: list[int]

    @property
    def triangles(self) -> list[Ints]:
        """Triangles of each part."""
        counts = np.bincount(self.label, minlength=len(self.names))
        return np.split(np.argsort(self.label, kind="stable"), np.cumsum(counts)[:-1])

    def titles(self, name: str) -> list[str]:
        """A distinct name for each part; ``name`` for one that is in no group."""
        return distinct([" ".join(names) or name for names in self.names])


def split_parts(mesh: PaintedMesh, *, by_material: bool = True) -> Parts:
    """Part the triangles by their groups and, by default, by their material."""
    members = list(mesh.groups.values())
    owner = np.concatenate([np.zeros(0, dtype=np.int64), *members])
    group = np.repeat(np.arange(len(members)), [len(each) for each in members])
    order = np.argsort(owner, kind="stable")
    # Groups of each triangle, counted from the last one, which is 1; 0 after the last of each.
    groups = pad_rows(len(members) - group[order], owner[order], len(mesh.triangles))
    # Triangles without a material come first: OBJ cannot go back from a material to none.
    material = mesh.material if by_material else np.full(len(mesh.triangles), -1)
    pattern = np.column_stack([material, np.nan_to_num(groups)]).astype(np.int64)
    patterns, label = np.unique(pattern, axis=0, return_inverse=True)
    known = [*mesh.groups][::-1]
    names = [[known[i - 1] for i in row[1:] if i] for row in patterns.tolist()]
    return Parts(label.reshape(-1), names, patterns[:, 0].tolist())


def split_at_seams(triangles: Ints, uv: Floats) -> tuple[Ints, Ints, Floats]:
    """Double the vertices at texture seams, so that each has one pair of texture coordinates.

    Returns
    -------
    (n,) int64
        Old vertex of each new one.
    (T, 3) int64
        Triangles on the new vertices.
    (n, 2) float64
        Texture coordinates of the new vertices; 0 for those without.
    """
    rows = np.column_stack([triangles.ravel(), np.nan_to_num(uv.reshape(-1, 2))])
    found, place = np.unique(rows, axis=0, return_inverse=True)
    return found[:, 0].astype(np.int64), place.reshape(-1, 3), found[:, 1:]


def obj_word(name: str) -> str:
    """The name as one word of an OBJ file: no comment, and no backslash that continues the line."""
    word = "_".join(name.split())
    return re.sub(r"^#|\\$", "_", word)


def distinct(titles: list[str]) -> list[str]:
    """The titles, with a number added to those that repeat an earlier one."""
    counts: dict[str, int] = {}
    out = []
    for title in titles:
        counts[title] = counts.get(title, 0) + 1
        out.append(title if counts[title] == 1 else f"{title} {counts[title]}")
    return out
