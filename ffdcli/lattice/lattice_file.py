"""Lattice files as read and checked, and their lattices settled by a mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import LatticeError
from ffdcli.lattice.border import Border, crossed_sides, lock_layers, lock_octree
from ffdcli.lattice.box_contacts import require_clear, shared_sides
from ffdcli.lattice.box_lattice import BoxLattice, control_net
from ffdcli.lattice.edit.apply import apply_edits
from ffdcli.lattice.file.definition import Definition, load_definition
from ffdcli.lattice.file.load import parse_parts, parse_spec
from ffdcli.lattice.file.source import Source, read_yaml
from ffdcli.lattice.lattice import Lattice
from ffdcli.lattice.layout import Layout, bspline_at_rest, interior_fractions, lay_out

if TYPE_CHECKING:
    from ffdcli.lattice.drag.holds import Groups
    from ffdcli.volume.adaptive.inverse_map import AnyMap
    from ffdcli.volume.adaptive.octree import Cells, ModelTree

_APART = "the lattice box does not touch the mesh: nothing is deformed"
# Axes (3, 3) of the turned box of least volume round points (m, 3).
SmallestBox = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class MeshGeometry:
    """The facts of a mesh that settle a lattice; see :meth:`LatticeFile.settle`."""

    bounds: Floats
    triangles: Floats
    delta: float
    groups: Groups | None
    smallest_box: SmallestBox | None


def _place_box(definition: Definition, mesh: MeshGeometry) -> Layout:
    octree = definition.spec.octree
    if octree is None or octree.region == "auto":
        return lay_out(definition, mesh.bounds, mesh.delta)
    from ffdcli.lattice.octree_placement import oriented_layout, principal_axes

    points = mesh.triangles.reshape(-1, 3)
    if octree.region == "oriented":
        axes = principal_axes(mesh.triangles)
    elif mesh.smallest_box is not None:
        axes = mesh.smallest_box(points)
    else:
        message = "nothing here computes the box of least volume"
        hint = "say `region: oriented`"
        raise definition.source.error(("octree", "region"), message, hint)
    return oriented_layout(definition, points, axes, mesh.delta)


def _rest_of(
    definition: Definition, layout: Layout, mesh: MeshGeometry, shared: frozenset[str]
) -> tuple[BoxLattice, Floats, int]:
    """Lock and divide one placed box, of which some sides lie on other boxes.

    Returns what :func:`apply_edits` takes: the lattice, the triangles of the mesh in its frame, and
    the number of edits that the lattice has already.
    """
    spec = definition.spec
    triangles = layout.frame.to_local(mesh.triangles)
    interior = interior_fractions(spec)
    apart = np.any(triangles.min(axis=(0, 1)) > layout.box[1])
    apart |= np.any(triangles.max(axis=(0, 1)) < layout.box[0])

    def at_rest(start: AnyMap, cells: ModelTree[Cells] | None, border: Border) -> BoxLattice:
        return BoxLattice(
            definition,
            layout,
            cells,
            border,
            mesh.groups,
            start,
            control_net(start, interior, start.rest_points, start.rest_weights),
            (*definition.notes, *((_APART,) if apart else ())),
            {},
        )

    def on_cells(divided: Sequence[Ints] = ()) -> BoxLattice:
        # Only octrees need these libraries.
        from ffdcli.lattice.octree_placement import octree_at_rest

        start, cells = octree_at_rest(definition, layout, triangles, divided)
        crossed = crossed_sides(triangles, start.box, mesh.delta)
        return at_rest(start, cells, lock_octree(start, crossed, shared))

    if spec.grown:
        from ffdcli.lattice.edit.fit_growth import grow_by_fit

        return grow_by_fit(definition, on_cells, triangles), triangles, 1
    if spec.adaptive:
        return on_cells(), triangles, 0
    border = lock_layers(spec, crossed_sides(triangles, layout.box, mesh.delta), shared)
    return at_rest(bspline_at_rest(spec, layout, interior), None, border), triangles, 0


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
        return Lattice(tuple(apply_edits(*each) for each in self.at_rest(mesh)), self.source)

    def at_rest(self, mesh: MeshGeometry) -> tuple[tuple[BoxLattice, Floats, int], ...]:
        """Each lattice fitted to a mesh before its edits, as :func:`apply_edits` takes it.

        Raises
        ------
        LatticeError
            A box has no extent, or two boxes overlap or come too near each other.
        """
        require_clear(self.definitions)
        layouts = [_place_box(definition, mesh) for definition in self.definitions]
        size = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
        shared = shared_sides(self.definitions, layouts, mesh.delta, size)
        return tuple(
            _rest_of(definition, layout, mesh, frozenset(sides))
            for definition, layout, sides in zip(self.definitions, layouts, shared, strict=True)
        )

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
