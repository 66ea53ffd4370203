"""Labels of polygons: their bodies, groups and materials, as the mesh file names them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Ints

# Characters of a name; what is longer is cut.
LONGEST_NAME = 1000
# Characters that formats cannot hold, or that end a line of a text file.
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028\u2029]")
_NO_CHARACTER = re.compile("[\ud800-\udfff\ufffe\uffff]")

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


def plain_text(value: str, longest: int = LONGEST_NAME) -> str:
    """The text as every format can hold it.

    Control characters and ends of lines become spaces, and halves of surrogate pairs and
    non-characters U+FFFD; a text of more than `longest` characters is cut, and ends in ``…``.
    """
    plain = _NO_CHARACTER.sub("\ufffd", _CONTROL.sub(" ", value))
    return plain if len(plain) <= longest else plain[: longest - 1] + "…"


def plain_names(names: Iterable[str]) -> dict[str, str]:
    """The names that `plain_text` changes, each with its new name; no two names become equal."""
    given = dict.fromkeys(names)
    known, changed = set(given), {}
    numbers: Counter[str] = Counter()
    for name in given:
        plain = new = plain_text(name)
        while new != name and new in known:
            numbers[plain] += 1
            mark = f" {numbers[plain] + 1}"
            new = plain_text(plain, LONGEST_NAME - len(mark)) + mark
        if new != name:
            changed[name] = new
            known.add(new)
    return changed
