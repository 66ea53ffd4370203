"""Labels of polygons: their bodies, groups and materials, as the mesh file names them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Ints

# Red, green and blue in sRGB, each from 0 to 1.
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A material of the mesh file, with the path of the image for its colour (``map_Kd`` of OBJ).

    The name is empty, and colour and image None, if the file gives none.
    """

    name: str
    colour: Colour | None = None
    image: str | None = None


@dataclass(frozen=True)
class Labels:
    """Body, group and material of each polygon.

    Parameters
    ----------
    bodies, groups : tuple of str
    materials : tuple of Material
    body, group, material : (P,) int64
        Position of each polygon's in the tuple; -1 for none.
    """

    bodies: tuple[str, ...]
    groups: tuple[str, ...]
    materials: tuple[Material, ...]
    body: Ints
    group: Ints
    material: Ints

    def take(self, polygons: Ints) -> Labels:
        """Labels of polygons (n,), in this order and as often as given."""
        return replace(
            self,
            body=self.body[polygons],
            group=self.group[polygons],
            material=self.material[polygons],
        )


def number_names(names: list[str]) -> tuple[tuple[str, ...], Ints]:
    """Each name once, in order of appearance, and (n,) the position of each; -1 for ``""``."""
    places: dict[str, int] = {"": -1}
    numbers = [places.setdefault(name, len(places) - 1) for name in names]
    return tuple(places)[1:], np.array(numbers, dtype=np.int64)
