"""The main path, one screen: mesh and lattice in, exact trimmed surfaces out.

    mesh -> planes -> cut -> regions -> outlines -> patches + curves -> B-rep -> OpenCascade -> file

``prepare`` does all that depends on the mesh and the knots alone; the plan it returns is applied to
as many control nets as one likes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from ffdcli.brep.assemble import (
    Geometry,
    assemble,
    deviation_bound,
    edge_gaps,
    reverse_shells,
)
from ffdcli.brep.record import Brep
from ffdcli.brep.shells import find_mirrored, group_shells
from ffdcli.errors import CheckError, LatticeError
from ffdcli.mesh import (
    Mesh,
    Soundness,
    inspect,
    require_closed,
    require_usable,
    smallest_box,
    triangles,
)
from ffdcli.result import Origin, Result
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.surface.curves import plan_curves
from ffdcli.surface.flat import find_affine
from ffdcli.surface.graph import fit_graphs, plane_deviation
from ffdcli.surface.outlines import trace_outlines
from ffdcli.surface.partition import OUTSIDE, Partition, partition
from ffdcli.surface.planes import find_planes, join_parallel
from ffdcli.surface.refine import keep_overshoot_small, keep_weights_positive
from ffdcli.surface.tolerance import Tolerances, kernel_tolerance
from ffdcli.volume.protocol import Volume

if TYPE_CHECKING:
    from ffdcli.lattice import AnyLattice

Patches = Literal["merged", "bezier"]


def read_lattice(path: str | Path, mesh: Mesh | None = None) -> AnyLattice:
    """Read a lattice file; the mesh settles its automatic box and its locked borders.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh, optional
        Without it the lattice can be inspected, but not used.

    Raises
    ------
    FileError, LatticeError
        Naming file, line and key.
    """
    from ffdcli.lattice import load_lattice

    lattice = load_lattice(path)
    if mesh is None:
        return lattice
    corners, polygon = triangles(mesh)
    points = mesh.vertices[corners]
    groups = {name: points[np.isin(polygon, members)] for name, members in mesh.groups.items()}
    return lattice.settle(
        bounds=mesh.bounds,
        triangles=points,
        delta=mesh.delta,
        groups=groups,
        smallest_box=smallest_box,
    )


def deform(
    mesh: Mesh,
    lattice: AnyLattice,
    *,
    patches: Patches = "merged",
    check: bool = True,
    require_solid: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Bend a mesh with a lattice into exact trimmed surfaces.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice or Lattices
        Settled by the mesh.
    patches : {"merged", "bezier"}
        One surface per planar region, or the paper's partition into Bézier patches.
    check : bool
        Check topology, volume, and curves against surfaces before the result is handed out.
    require_solid : bool
        Refuse an open mesh, which gives an open shell otherwise.
    progress : callable, optional
        Told the name of each stage as it begins.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    if require_solid:
        require_closed(mesh, inspect(mesh))
    plan = prepare(mesh, lattice, patches=patches, progress=progress)
    return plan.deform(lattice, check=check, progress=progress)


def prepare(
    mesh: Mesh,
    lattice: AnyLattice,
    *,
    patches: Patches = "merged",
    progress: Progress | None = None,
) -> Plan:
    """Do once what depends on the mesh and the knots alone: planes, cuts, outlines, patterns.

    Parameters
    ----------
    mesh, lattice, patches, progress
        As for :func:`deform`. Where the lattice has weights, cuts are added until all surfaces
        have positive weights; the plan then serves nets whose weights are alike.

    Raises
    ------
    MeshError
        The mesh has faults that no face can be made of.
    LatticeError
        The lattice is not settled.
    CheckError
        Surfaces whose weights cannot be made positive.
    """
    stage = Stopwatch(progress)
    volumes = lattice.volumes
    with stage("check mesh"):
        soundness = inspect(mesh)
        require_usable(mesh, soundness)
        corners, polygon = triangles(mesh)
    with stage("planes"):
        local = np.hstack([volume.frame.to_local(mesh.vertices) for volume in volumes])
        groups = find_planes(local[:, :3], corners, polygon, mesh.delta)
        if patches == "bezier":
            groups = join_parallel(local[:, :3], corners, groups, mesh.delta)
        epsilon = plane_deviation(groups, mesh.delta)
        graphs = fit_graphs(local, corners, groups, volumes, epsilon)
    with stage("cut"):
        every_knot = patches == "bezier"
        limits = Tolerances(mesh.size, epsilon, kernel_tolerance(mesh.vertices))
        parts = partition(local, corners, groups, graphs, volumes, limits, every_knot=every_knot)
        parts = keep_overshoot_small(parts, groups, graphs, volumes, limits, shared=every_knot)
        parts, batches = keep_weights_positive(
            parts, groups, graphs, volumes, limits, shared=every_knot
        )
    with stage("outlines"):
        flat = (graphs.axes[parts.group, 1:] + 3 * parts.frame[:, None])[parts.patch]
        outlines = trace_outlines(parts, flat, epsilon)
        shells = group_shells(soundness.nesting, polygon, parts)
    with stage("plan"):
        beside = parts.zone[parts.patch[outlines.edge_regions]]
        zone = np.where(outlines.edge_regions >= 0, beside, OUTSIDE).max(axis=1)
        geometry = Geometry(
            parts=parts,
            graphs=graphs,
            outlines=outlines,
            patches=batches,
            curves=plan_curves(parts.pieces.vertices, outlines.edges, zone, volumes, limits),
            shells=shells,
            model_vertices=mesh.vertices,
            tolerances=limits,
        )
    pieces = np.column_stack([polygon[parts.pieces.triangle], parts.region])
    return Plan(
        origin=Origin(mesh, soundness, epsilon, len(np.unique(pieces, axis=0))),
        volumes=volumes,
        geometry=geometry,
        seconds=stage.seconds,
    )


@dataclass(frozen=True)
class Plan:
    """A mesh cut for one set of knots, ready for any control net on them.

    Parameters
    ----------
    origin : Origin
    volumes : tuple of Volume
        Degrees, knots and frames the plan holds for.
    geometry : Geometry
    seconds : dict of str to float
    """

    origin: Origin
    volumes: tuple[Volume, ...]
    geometry: Geometry
    seconds: dict[str, float]

    def fits(self, volumes: Sequence[Volume]) -> bool:
        """Whether the plan was prepared for as many volumes of the same degrees, knots, boxes."""
        return len(volumes) == len(self.volumes) and all(
            mine.same_basis(other) for mine, other in zip(self.volumes, volumes, strict=True)
        )

    def deform(
        self, lattice: AnyLattice, *, check: bool = True, progress: Progress | None = None
    ) -> Result:
        """Apply a lattice with the knots of the plan.

        Raises
        ------
        LatticeError
            The lattice has other degrees, knots or another box, or weights for which some surface
            of this plan would have negative ones.
        CheckError
            The result is no sound solid, as when the lattice folds the model over.
        """
        volumes = lattice.volumes
        if not self.fits(volumes):
            raise LatticeError(
                "the plan was prepared for other degrees, knots or another box",
                hint="prepare a plan with this lattice",
            )
        stage = Stopwatch(progress)
        with stage("surfaces"):
            maps = find_affine(volumes, self.geometry.patches, self.geometry.parts)
            gaps = edge_gaps(self.geometry, volumes)
            brep = assemble(self.geometry, volumes, maps, gaps)
            mirrored = find_mirrored(self.geometry.parts, self.geometry.shells, volumes)
            brep = reverse_shells(brep, mirrored)
        if check:
            with stage("check"):
                _require_sound(brep)
        mesh = self.origin.mesh
        unit = lattice.unit or mesh.unit or "mm"
        warnings = (
            *mesh.notes,
            *_open_edges(self.origin.soundness),
            *lattice.warnings,
            *_untouched(self.geometry.parts, volumes),
        )
        seconds = {**self.seconds, **stage.seconds}
        deviation = deviation_bound(self.geometry, volumes, gaps)
        return Result(self.origin, brep, unit, deviation, seconds, warnings)


def _open_edges(soundness: Soundness) -> list[str]:
    """The warning an open mesh earns."""
    found = soundness.open_edges
    if found.place is None:
        return []
    place = ", ".join(f"{value:.6g}" for value in found.place)
    return [
        f"the mesh is open: {found.count} edges belong to one polygon only, the first at ({place});"
        " the result is an open shell"
    ]


def _untouched(parts: Partition, volumes: Sequence[Volume]) -> list[str]:
    """The warning a lattice inside the solid, or in a hollow of it, earns."""
    warnings = []
    for number, volume in enumerate(volumes):
        used = parts.in_frame(number)[parts.pieces.corners]
        beside = (used.min(axis=0) > volume.box[1]) | (used.max(axis=0) < volume.box[0])
        if not ((parts.zone == number).any() or beside.any()):
            which = f"lattices[{number}]: " if len(volumes) > 1 else ""
            said = "no part of the mesh's surface lies in the lattice box: nothing is deformed"
            warnings.append(which + said)
    return warnings


def _require_sound(brep: Brep) -> None:
    from ffdcli.brep.verify.own import check_brep

    report = check_brep(brep)
    if report.faults:
        raise CheckError(
            "the result failed its own check: " + "; ".join(report.faults),
            hint="nothing was written; the lattice may fold the model there",
        )
