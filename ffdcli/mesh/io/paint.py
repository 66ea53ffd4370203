"""Materials of triangles, and the names that files give them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.labels import Colour, Material

# What stands for the colour of a material that has none, where a format asks for one.
GREY: Colour = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class Paint:
    """Materials of triangles.

    Parameters
    ----------
    materials : tuple of Material
    material : (T,) int64
        Position of each triangle's in ``materials``; -1 for none.
    """

    materials: tuple[Material, ...]
    material: Ints

    @property
    def names(self) -> list[str]:
        """A name for each material, of one word, none like another."""
        words = ["_".join(each.name.split()) for each in self.materials]
        return [w.replace(" ", "_") for w in distinct([word or "material" for word in words])]

    @property
    def coloured(self) -> bool:
        """Whether any material has a colour."""
        return any(each.colour is not None for each in self.materials)

    def face_colours(self) -> Ints:
        """(T, 4) red, green, blue and opacity of triangles, 0 to 255; grey for those without."""
        table = [each.colour or GREY for each in self.materials] + [GREY]
        levels = np.round(255 * np.array(table)[self.material]).astype(np.uint8)
        return np.column_stack([levels, np.full(len(levels), 255, dtype=np.uint8)])


def distinct(titles: list[str]) -> list[str]:
    """The same, made different where two are alike."""
    counts: dict[str, int] = {}
    out = []
    for title in titles:
        counts[title] = counts.get(title, 0) + 1
        out.append(title if counts[title] == 1 else f"{title} {counts[title]}")
    return out
