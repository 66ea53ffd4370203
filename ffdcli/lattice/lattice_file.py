"""A lattice file as read and checked, before a mesh settles boxes, octrees and locked layers."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NoReturn

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.file.definition import Definition, load_definition
from ffdcli.lattice.file.load import parse_parts, parse_spec
from ffdcli.lattice.file.source import Source, read_yaml
from ffdcli.lattice.lattice import Lattice
from ffdcli.lattice.settle import MeshGeometry, SmallestBox, settle

# Public attributes of a settled lattice.
_SETTLED = {field.name for field in fields(Lattice)} | {
    name for name in vars(Lattice) if not name.startswith("_")
}


@dataclass(frozen=True, eq=False)
class LatticeFile:
    """The lattices that a file defines; :meth:`settle` fits them to a mesh.

    Parameters
    ----------
    definitions : tuple of Definition
        In the order of the file.
    source : Source
        File and lines of the keys, for messages.
    """

    definitions: tuple[Definition, ...]
    source: Source

    @property
    def unit(self) -> str | None:
        """Length unit that the file states."""
        return self.definitions[0].spec.unit

    @property
    def listed(self) -> bool:
        """Whether the file has the key `lattices`, a list."""
        return bool(self.definitions[0].source.root)

    def settle(
        self,
        *,
        bounds: Floats,
        triangles: Floats,
        delta: float,
        groups: Groups | None = None,
        smallest_box: SmallestBox | None = None,
    ) -> Lattice:
        """Fit the lattices to a mesh: place boxes, lock layers, apply edits.

        Where two boxes touch side to side, both sides are locked, so that the deformation is
        continuous across them.

        Parameters
        ----------
        bounds : (2, 3) float64, model length
            Bounding box of the mesh.
        triangles : (T, 3, 3) float64, model length
            The mesh's polygons as triangles.
        delta : float, model length
            Distance within which points count as coplanar.
        groups : mapping of str to (T, 3, 3) float64, optional, model length
            Triangles of the mesh's named groups, for `hold: [{group: name}]`.
        smallest_box : callable, optional
            Axes (3, 3) of the box of least volume round points (m, 3), for `region: minimum`.

        Raises
        ------
        LatticeError
            A box has no extent, two boxes overlap or come too near each other, or an edit cannot
            be applied; names the key.
        """
        mesh = MeshGeometry(bounds, triangles, delta, groups, smallest_box)
        return Lattice(settle(self.definitions, mesh), self.source)

    def __getattr__(self, name: str) -> NoReturn:
        """Raise an error for the attributes that only a settled lattice has.

        Raises
        ------
        LatticeError
            States what the mesh is needed for.
        """
        if name not in _SETTLED:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        spec = self.definitions[0].spec
        why = "its box is automatic" if spec.box == "auto" else "its borders depend on it"
        why = "its cells depend on it" if spec.adaptive else why
        raise LatticeError(
            f"the lattice needs a mesh before it can be used: {why}",
            file=self.source.name,
            hint="give the mesh too, as in read_lattice(path, mesh)",
        )


def load_lattice(path: str | Path) -> LatticeFile:
    """Read and check a lattice file and the files that it names.

    Raises
    ------
    FileError
        The file cannot be read.
    LatticeError
        It is not a valid lattice file; names line and key.
    """
    return parse_lattice(*read_yaml(path))


def parse_lattice(data: Any, source: Source) -> LatticeFile:
    """Check the plain values of a lattice file, and read the files that they name.

    Raises
    ------
    LatticeError
        The values are not those of a lattice file; names line and key.
    """
    if not (isinstance(data, dict) and "lattices" in data):
        return LatticeFile((load_definition(parse_spec(data, source), source),), source)
    parts = [
        load_definition(spec, source.within(("lattices", number)))
        for number, spec in enumerate(parse_parts(data, source))
    ]
    return LatticeFile(tuple(parts), source)
