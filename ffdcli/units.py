"""Units of length, by their names in ffd, OpenCascade and STEP. Coordinates are never scaled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ffdcli.errors import KernelError

UnitName = Literal["um", "mm", "cm", "m", "km", "inch", "ft", "mile"]
UNIT_NAMES: tuple[str, ...] = get_args(UnitName)


@dataclass(frozen=True)
class Unit:
    """A unit of length: its names in ffd, OpenCascade, STEP (in lower case) and 3MF (or None).

    Its IGES number is the unit flag of the global section (IGES 5.3, 2.2.4.3.14).
    """

    name: str
    kernel: str
    step: str
    iges: int
    threemf: str | None
    millimetres: float


UNITS = (
    Unit("mm", "MM", "millimetre", 2, "millimeter", 1.0),
    Unit("cm", "CM", "centimetre", 10, "centimeter", 10.0),
    Unit("m", "M", "metre", 6, "meter", 1000.0),
    Unit("km", "KM", "kilometre", 7, None, 1e6),
    Unit("um", "UM", "micrometre", 9, "micron", 1e-3),
    Unit("inch", "INCH", "inch", 1, "inch", 25.4),
    Unit("ft", "FT", "foot", 4, "foot", 304.8),
    Unit("mile", "MI", "mile", 5, None, 1609344.0),
)

# Words for units in mesh files, besides those of `UNITS`; a plural s is dropped before.
_WORDS = {
    "in": "inch", '"': "inch", "inche": "inch", "'": "ft", "feet": "ft", "mi": "mile",
    "millimetre": "mm", "centimetre": "cm", "metre": "m", "kilometer": "km", "kilometre": "km",
    "micrometer": "um", "micrometre": "um", "\u00b5m": "um", "\u03bcm": "um",
}  # fmt: skip
_WORDS |= {unit.threemf: unit.name for unit in UNITS if unit.threemf is not None}
_WORDS |= {unit.name: unit.name for unit in UNITS}


def unit_in_words(text: str) -> str | None:
    """The unit that a mesh file calls ``millimeters``, ``in``, ``"`` and the like, or None."""
    word = text.strip().lower()
    return _WORDS.get(word) or _WORDS.get(word.removesuffix("s"))


def unit_named(name: str) -> Unit:
    """The unit with a name, or a KernelError."""
    for unit in UNITS:
        if unit.name == name:
            return unit
    known = ", ".join(unit.name for unit in UNITS)
    raise KernelError(f"a CAD file cannot be written in the unit {name!r}", hint=f"use {known}")
