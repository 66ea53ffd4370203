"""Counts and points, formatted for messages."""

from __future__ import annotations

from ffdcli.arrays import Floats


def counted(count: int, one: str, several: str) -> str:
    """``1 polygon was``, ``3 polygons were``."""
    return f"{count} {one if count == 1 else several}"


def place_text(point: Floats) -> str:
    """``(x, y, z)`` with nine digits."""
    return "(" + ", ".join(f"{x:.9g}" for x in point) + ")"
