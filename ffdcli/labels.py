"""What a mesh file calls its polygons: bodies, groups and materials, one integer per polygon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints

# Red, green and blue from 0 to 1, as screens have them (sRGB).
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A material of the mesh file.

    Parameters
    ----------
    name : str
        Empty where the file gives none.
    colour : (float, float, float) or None
        sRGB, each from 0 to 1; None where the file gives none.
    image : str or None
        Path of the image that an OBJ material names for its colour (``map_Kd``).
    """

    name: str
    colour: Colour | None = None
    image: str | None = None


@dataclass(frozen=True)
class Labels:
    """Names and materials of a mesh's polygons.

    Parameters
    ----------
    bodies, groups : tuple of str
    materials : tuple of Material
    body, group, material : (P,) int64
        Position in those of each polygon's; -1 for none.
    """

    bodies: tuple[str, ...]
    groups: tuple[str, ...]
    materials: tuple[Material, ...]
    body: Ints
    group: Ints
    material: Ints

    def take(self, polygons: Ints) -> Labels:
        """Labels of chosen polygons (n,), or of the pieces that polygons were split into."""
        return Labels(
            self.bodies,
            self.groups,
            self.materials,
            self.body[polygons],
            self.group[polygons],
            self.material[polygons],
        )


def number_names(names: list[str]) -> tuple[tuple[str, ...], Ints]:
    """Each name once, in order of appearance, and (n,) the position of each; -1 for ``""``."""
    places: dict[str, int] = {"": -1}
    numbers = [places.setdefault(name, len(places) - 1) for name in names]
    return tuple(places)[1:], np.array(numbers, dtype=np.int64)
