"""Lattices settled by a mesh: boxes placed, octrees refined, sides locked, edits applied."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.border import crossed_sides, lock_layers, lock_octree
from ffdcli.lattice.box_contacts import require_clear, shared_sides
from ffdcli.lattice.box_lattice import BoxLattice, control_net
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.edit.apply import apply_edits
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.layout import Layout, bspline_at_rest, interior_fractions, lay_out
from ffdcli.lattice.octree_placement import octree_at_rest, oriented_layout, principal_axes
from ffdcli.volume.adaptive.inverse_map import AnyMap

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


def _settle_one(
    definition: Definition, layout: Layout, mesh: MeshGeometry, shared: frozenset[str]
) -> BoxLattice:
    """Lock, divide and edit one placed box, of which some sides lie on other boxes."""
    spec, cells = definition.spec, None
    triangles = layout.frame.to_local(mesh.triangles)
    interior = interior_fractions(spec)
    start: AnyMap
    if spec.adaptive:
        start, cells = octree_at_rest(definition, layout, triangles)
        crossed = crossed_sides(triangles, start.box, mesh.delta)
        border = lock_octree(start, crossed, shared)
    else:
        start = bspline_at_rest(spec, layout, interior)
        border = lock_layers(spec, crossed_sides(triangles, layout.box, mesh.delta), shared)
    lattice = BoxLattice(
        definition,
        layout,
        cells,
        border,
        mesh.groups,
        start,
        control_net(start, interior, start.rest_points, start.rest_weights),
        tuple(_placement_warnings(triangles, layout.box)),
        {},
    )
    return apply_edits(lattice, triangles)


def _placement_warnings(triangles: Floats, box: Floats) -> list[str]:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if np.any(low > box[1]) or np.any(high < box[0]):
        return ["the lattice box does not touch the mesh: nothing is deformed"]
    return []
