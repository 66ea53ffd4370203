"""Mesh output by name: formats by extension, and modes. Light, so that the command line may ask."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

Subdivision = Literal["vertices", "uniform", "adaptive"]
SUBDIVISIONS: tuple[str, ...] = get_args(Subdivision)

# Formats by extension.
MESH_FORMATS = {
    ".stl": "STL",
    ".obj": "OBJ",
    ".ply": "PLY",
    ".off": "OFF",
    ".glb": "GLB",
    ".3mf": "3MF",
}


def mesh_format(path: str | Path) -> str | None:
    """Return the format's name, or None for an extension that no mesh is written to."""
    return MESH_FORMATS.get(Path(path).suffix.lower())
