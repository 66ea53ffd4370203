"""Scene of a deformation: mesh and lattice before, exact faces and lattice after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.deformation import Deformation
from ffdcli.mesh import Mesh, triangles
from ffdcli.messages import printable
from ffdcli.result import Result
from ffdcli.verify.file import face_deviations
from ffdcli.view.scene import DrawnNet, Faces, Scene, Skin, colour_faces, grid_lines, skin
from ffdcli.volume.adaptive.octree import CHILDREN, interleave

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice

# Distance of the drawn triangles from the exact faces, as a share of the mesh size.
CHORD = 5e-4
# Number of amplitudes if there are weights: then points do not move along straight lines.
_FRAMES = 11


def scene_of(
    mesh: Mesh,
    lattice: Lattice,
    result: Result,
    *,
    deviations: bool = True,
    hidden_points: bool = False,
) -> Scene:
    """Collect the scene of a deformation.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Fitted to the mesh.
    result : Result
        The exact faces.
    deviations : bool
        Measure the distance of each face from the deformed mesh, which is slow.
    hidden_points : bool
        Draw the hidden control points of octrees.

    Raises
    ------
    CheckError
        The faces cannot be triangulated.
    """
    members = lattice.members
    fine = result.tessellate(CHORD * mesh.size)
    amplitudes = amplitudes_of(lattice)
    between = [lattice.scaled(float(share)) for share in amplitudes[1:-1]]
    moved = [Deformation.of(each, mesh.delta).images(fine.rest) for each in between]
    frames = np.stack([fine.rest, *moved, fine.points])
    report, degrees = result.report, result.brep.surface_degrees
    solids = report["solids"]
    body = f"{solids} solid{'s' * (solids > 1)}" if solids else "an open shell"
    return Scene(
        title=printable(Path(mesh.source).name),
        facts=f"{mesh.polygon_count} polygons became {body} of {result.brep.face_count} faces.",
        unit=result.unit,
        amplitudes=amplitudes,
        before=mesh_skin(mesh),
        after=skin(frames, fine.triangles, fine.owner),
        faces=Faces(
            degrees=tuple(degrees[surface] for surface in result.brep.face_surface),
            deviation=face_deviations(result.brep, mesh, lattice) if deviations else None,
            colour=colour_faces(fine.triangles, fine.owner, result.brep.face_count),
        ),
        lattices=tuple(drawn_net(one, amplitudes) for one in members),
        drags=drags_of(members),
        cells=cell_edges(members),
        hidden_points=hidden_points,
    )


def amplitudes_of(lattice: Lattice) -> Floats:
    """(S,) amplitudes from 0 (rest) to 1 at which scenes have points; those between go straight."""
    steps = _FRAMES if any(volume.net_kind.rational for volume in lattice.maps) else 2
    return np.linspace(0, 1, steps)


def mesh_skin(mesh: Mesh) -> Skin:
    """Skin of the undeformed mesh, with its polygons as faces."""
    corners, polygon = triangles(mesh)
    return skin(mesh.vertices[None], corners, polygon)


def drawn_net(lattice: BoxLattice, amplitudes: Floats) -> DrawnNet:
    """Control points of a lattice at amplitudes (S,) from 0 (rest) to 1."""
    frame = lattice.map.frame
    nets = [frame.to_model(lattice.scaled(float(share)).points) for share in amplitudes]
    shape = lattice.points.shape[:-1]
    return DrawnNet(
        frames=np.stack([net.reshape(-1, 3) for net in nets]),
        # The control points of an octree have cells instead.
        lines=grid_lines(shape) if len(shape) == 3 else np.zeros((0, 2), dtype=np.int64),
        locked=lattice.locked.ravel(),
        hidden=_of_empty_cells(lattice).ravel(),
    )


def _of_empty_cells(lattice: BoxLattice) -> Bools:
    """(...) True for the control points of an octree's empty cells.

    Those of T-splines are hidden from edits too (Song & Yang 2005, section 4.2). In a hierarchical
    volume a control point belongs to the cells of its own level that hold or touch its place at
    rest; a cell that is divided further is empty where all its parts are.
    """
    rest, model = lattice.start, lattice.cells
    if model is None or not rest.linear_precision:
        return rest.hidden
    box, tree = lattice.layout.box, model.tree
    empty = np.ones(rest.shape, dtype=bool)
    for level in range(int(rest.levels.max(initial=0)) + 1):
        mine = np.flatnonzero(rest.levels == level)
        side = tree.counts >> level
        full = interleave(tree.low[model.full & (tree.levels >= level)] // side)
        # In cells of the level; places are corners or middles of cells.
        place = (rest.rest_points[mine] - box[0]) / (box[1] - box[0]) * (1 << level)
        halves = np.rint(2 * place).astype(np.int64)
        for above in CHILDREN:
            cell = (halves - 1 + above) >> 1
            within = ((cell >= 0) & (cell < 1 << level)).all(axis=1)
            held = np.isin(interleave(cell[within]), full)
            empty[mine[within][held]] = False
    return empty


def cell_edges(lattices: tuple[BoxLattice, ...]) -> Floats:
    """(m, 2, 3) edges of the cells of octrees that the mesh passes through, model length."""
    found = [np.zeros((0, 2, 3))]
    for lattice in lattices:
        cells, end = lattice.full_cells, np.indices((2, 2, 2)).reshape(3, -1).T
        corners = cells[:, end, np.arange(3)]
        edges = corners[:, grid_lines((2, 2, 2))].reshape(-1, 3)
        found.append(lattice.map.frame.to_model(edges).reshape(-1, 2, 3))
    return np.unique(np.concatenate(found), axis=0)


def drags_of(lattices: tuple[BoxLattice, ...]) -> Floats:
    """Start and end of all pairs of the drags, (k, 2, 3), model length; those of fits are many."""
    found = [
        np.stack([table.sources, table.goals + np.where(table.by[:, None], table.sources, 0)], 1)
        for lattice in lattices
        for number, table in lattice.definition.pairs.items()
        if lattice.spec.edits[number].name == "drag"
    ]
    return np.concatenate([np.zeros((0, 2, 3)), *found])
