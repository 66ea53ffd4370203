"""How counts and places are put into sentences."""

from __future__ import annotations

from ffdcli.mesh.record import Floats, Mesh


def counted(count: int, one: str, several: str) -> str:
    """``1 polygon was``, ``3 polygons were``."""
    return f"{count} {one if count == 1 else several}"


def place_text(point: Floats) -> str:
    """Coordinates for a message."""
    return "(" + ", ".join(f"{x:.9g}" for x in point) + ")"


def polygon_place(mesh: Mesh, polygon: int) -> str:
    """The middle of a polygon's corners, for a message."""
    loop = mesh.corners[mesh.starts[polygon] : mesh.starts[polygon + 1]]
    return place_text(mesh.vertices[loop].mean(axis=0))
