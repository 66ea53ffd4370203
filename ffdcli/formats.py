"""Mesh file formats that can be written, and modes of subdivision. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from ffdcli.units import UNITS

Subdivision = Literal["vertices", "uniform", "adaptive"]
SUBDIVISIONS: tuple[str, ...] = get_args(Subdivision)


@dataclass(frozen=True)
class MeshFormat:
    """A mesh format that is written.

    Parameters
    ----------
    names, colours, texture : bool
        Whether it holds names of groups, colours of materials, and texture coordinates.
    single_precision : bool
        Whether its coordinates have single precision.
    units : sequence of str or None
        Units that it can state; None if it states none.
    """

    name: str
    names: bool = False
    colours: bool = False
    texture: bool = False
    single_precision: bool = False
    units: Sequence[str] | None = None

    @property
    def keeps(self) -> list[Literal["names", "texture"]]:
        """Of names and texture coordinates, those that the format holds."""
        names: list[Literal["names", "texture"]] = ["names"] if self.names else []
        return [*names, "texture"] if self.texture else names


_THREEMF_UNITS = tuple(unit.name for unit in UNITS if unit.threemf is not None)

# Formats by extension.
MESH_FORMATS = {
    ".stl": MeshFormat("STL", single_precision=True),
    ".obj": MeshFormat("OBJ", names=True, colours=True, texture=True),
    ".ply": MeshFormat("PLY", colours=True, texture=True, single_precision=True),
    ".off": MeshFormat("OFF"),
    ".glb": MeshFormat("GLB", names=True, colours=True, texture=True, single_precision=True),
    ".3mf": MeshFormat("3MF", names=True, colours=True, units=_THREEMF_UNITS),
}


def mesh_format(path: str | Path) -> MeshFormat | None:
    """The format of a file's extension, or None if no mesh is written to it."""
    return MESH_FORMATS.get(Path(path).suffix.lower())
