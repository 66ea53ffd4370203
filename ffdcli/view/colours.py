"""Colours of pictures, from the palette of Okabe and Ito for colour-blind people."""

from __future__ import annotations

BEFORE = "#d5d8dc"
LINE = "#20303c"
LATTICE = "#e69f00"
POINT = "#d55e00"
LOCKED = "#6b7683"
HIDDEN = "#7a3db8"
DRAG = "#0b4f8a"
CELL = "#009e73"
# Signed values: negative, zero, positive.
BELOW, NONE, ABOVE = "#0072b2", "#f4f4f2", "#d55e00"
# Faces: light, so that lines and control points stay visible; they differ in lightness too.
FACES = ("#8cc7ec", "#f3e489", "#7fcbb0", "#f0b594", "#5d9ac9", "#dcb0cd", "#c4cad0", "#f2cd85")


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, from 0 to 1, of a colour ``#rrggbb``."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
