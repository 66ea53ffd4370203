"""Lattices fitted to a mesh: boxes placed, sides locked, octrees grown, edits applied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.border import crossed_sides, lock_layers, lock_octree
from ffdcli.lattice.box_contacts import require_clear, shared_sides
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.edit.solve import solve
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.layout import Layout, lay_out
from ffdcli.lattice.octree_placement import (
    SmallestBox,
    oriented_layout,
    principal_axes,
    with_octree,
)


@dataclass(frozen=True, eq=False)
class MeshGeometry:
    """The facts of a mesh that settle a lattice; see :meth:`LatticeFile.settle`."""

    bounds: Floats
    triangles: Floats
    delta: float
    groups: Groups | None
    smallest_box: SmallestBox | None


def settle(definitions: Sequence[Definition], mesh: MeshGeometry) -> tuple[BoxLattice, ...]:
    """Fit each lattice of a file to a mesh.

    Raises
    ------
    LatticeError
    """
    require_clear(definitions)
    layouts = [_place_box(definition, mesh) for definition in definitions]
    size = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    shared = shared_sides(definitions, layouts, mesh.delta, size)
    return tuple(
        _settle_one(definition, layout, mesh, frozenset(sides))
        for definition, layout, sides in zip(definitions, layouts, shared, strict=True)
    )


def _place_box(definition: Definition, mesh: MeshGeometry) -> Layout:
    octree = definition.spec.octree
    if octree is None or octree.region == "auto":
        return lay_out(definition, mesh.bounds, mesh.delta)
    if octree.region == "minimum" and mesh.smallest_box is None:
        message = "the box of least volume is not known here"
        hint = "say `region: oriented`"
        raise definition.source.error(("octree", "region"), message, hint)
    smallest_box = mesh.smallest_box or principal_axes
    return oriented_layout(definition, mesh.triangles, mesh.delta, smallest_box)


def _settle_one(
    definition: Definition, layout: Layout, mesh: MeshGeometry, shared: frozenset[str]
) -> BoxLattice:
    """Lock, divide and edit one placed box, of which some sides lie on other boxes."""
    triangles = layout.frame.to_local(mesh.triangles)
    if definition.spec.adaptive:
        layout = with_octree(definition, layout, triangles)
    box = layout.box if layout.octree_map is None else layout.octree_map.box
    crossed = crossed_sides(triangles, box, mesh.delta)
    if layout.octree_map is None:
        border = lock_layers(definition.spec, crossed, shared)
    else:
        border = lock_octree(layout.octree_map, crossed, shared)
    solved = solve(definition, layout, border, mesh.groups, triangles)
    return BoxLattice(
        definition,
        layout,
        border,
        mesh.groups,
        solved.control,
        solved.map,
        (*_placement_warnings(triangles, layout.box), *solved.warnings),
        solved.successions,
    )


def _placement_warnings(triangles: Floats, box: Floats) -> list[str]:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if np.any(low > box[1]) or np.any(high < box[0]):
        return ["the lattice box lies beside the mesh: nothing is deformed"]
    return []
