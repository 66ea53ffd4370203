"""What depends on the mesh and the knots alone, done once, and applied to control nets.

mesh -> planes -> cut -> regions -> outlines -> patches + curves -> B-rep (-> reduced)
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.assemble import assemble
from ffdcli.brep.geometry import Geometry, plan_geometry
from ffdcli.brep.labels import label_faces
from ffdcli.brep.record import MassProperties
from ffdcli.brep.reduce import reduce_brep, require_reducible
from ffdcli.brep.shells import group_shells
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError
from ffdcli.fitting.lattice_fit import Fitted, fit_lattice, needs_fit, require_fit_tolerance
from ffdcli.folds.model import ModelInBox, place_in_each
from ffdcli.folds.verdict import Injectivity, injective_scale, judge
from ffdcli.mesh import (
    Mesh,
    Soundness,
    corner_triangles,
    describe_remarks,
    inspect,
    require_usable,
)
from ffdcli.mesh.charts import find_charts
from ffdcli.result import Origin, Result, require_sound
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.surface.graph import fit_graphs, plane_deviation
from ffdcli.surface.outlines import trace_outlines
from ffdcli.surface.partition import Partition, partition
from ffdcli.surface.planes import divide, find_planes, join_parallel
from ffdcli.surface.refine import keep_overshoot_small, keep_weights_positive
from ffdcli.surface.tolerance import Tolerances, kernel_tolerance
from ffdcli.tessellate.result import Domain
from ffdcli.tessellate.texture import face_texture
from ffdcli.volume.protocol import Volume

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

Patches = Literal["merged", "bezier"]
Kept = Literal["names", "texture"]


def prepare(
    mesh: Mesh,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    keep: Collection[Kept] = (),
    fit_tolerance: float | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Do once what depends on the mesh and the knots alone: planes, cuts, outlines, patterns.

    Parameters
    ----------
    mesh, lattice, patches, fit_tolerance, progress
        As for :func:`deform`. Where the lattice has weights, cuts are added until all surfaces
        have positive weights; the plan then serves nets whose weights are alike.
    keep : collection of {"names", "texture"}
        Divide faces where polygons have different names of groups or bodies, or different maps into
        the texture, so that the triangles of results have them too.

    Raises
    ------
    MeshError
        The mesh has faults that no face can be made of.
    LatticeError
        The lattice is not settled, or cannot be fitted within the tolerance.
    CheckError
        Surfaces whose weights cannot be made positive.
    """
    stage = Stopwatch(progress)
    require_fit_tolerance(fit_tolerance, lattice)
    with stage("check mesh"):
        soundness = inspect(mesh)
        require_usable(mesh, soundness)
        corner, polygon = corner_triangles(mesh)
        corners = mesh.corners[corner]
    fitted = None
    if needs_fit(lattice):
        with stage("fit"):
            fitted = fit_lattice(mesh, soundness.nesting, lattice, fit_tolerance)
    volumes = lattice.volumes if fitted is None else fitted.lattice.volumes
    with stage("planes", f"{len(corners):,} triangles"):
        local = np.hstack([volume.frame.to_local(mesh.vertices) for volume in volumes])
        groups = find_planes(local[:, :3], corners, polygon, mesh.delta)
        if patches == "bezier":
            groups = join_parallel(local[:, :3], corners, groups, mesh.delta)
        if mesh.labels is not None:
            groups = divide(local[:, :3], corners, groups, mesh.labels.material[polygon])
            if "names" in keep:
                groups = divide(local[:, :3], corners, groups, mesh.labels.group[polygon])
                groups = divide(local[:, :3], corners, groups, mesh.labels.body[polygon])
        uv = mesh.uv if "texture" in keep else None
        if uv is not None:
            charts = find_charts(mesh.vertices, corners, uv[corner], groups.group)
            groups = divide(local[:, :3], corners, groups, charts)
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
        shells = group_shells(soundness.nesting, polygon, parts, volumes)
    with stage("plan", f"{len(parts.patch):,} faces"):
        geometry = plan_geometry(
            parts, graphs, outlines, batches, shells, mesh.vertices, volumes, limits
        )
        models = place_in_each(mesh, soundness.nesting, volumes)
    piece_polygon = polygon[parts.pieces.triangle]
    face_polygon = np.zeros(len(parts.patch), dtype=np.int64)
    face_polygon[parts.region] = piece_polygon
    pieces = np.column_stack([piece_polygon, parts.region])
    labels = mesh.labels and label_faces(mesh.labels, piece_polygon, parts.region)
    return Plan(
        origin=Origin(mesh, soundness, epsilon, len(np.unique(pieces, axis=0)), labels),
        volumes=volumes,
        geometry=geometry,
        models=models,
        face_polygon=face_polygon,
        seconds=stage.seconds,
        corner=None if uv is None else corner,
        fitted=fitted,
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
    models : tuple of ModelInBox
        The mesh in the box of each volume, to tell whether it is folded over.
    face_polygon : (F,) int64
        A polygon of the mesh that is part of each face.
    seconds : dict of str to float
    corner : (T, 3) int64 or None
        Polygon corners of the triangles that were cut, where faces keep texture coordinates apart.
    fitted : Fitted or None
        What stands for a lattice that is no polynomial.
    """

    origin: Origin
    volumes: tuple[Volume, ...]
    geometry: Geometry
    models: tuple[ModelInBox, ...]
    face_polygon: Ints
    seconds: dict[str, float]
    corner: Ints | None = None
    fitted: Fitted | None = None

    def fits(self, volumes: Sequence[Volume]) -> bool:
        """Whether the plan was prepared for as many volumes of the same degrees, knots, boxes."""
        return len(volumes) == len(self.volumes) and all(
            mine.same_basis(other) for mine, other in zip(self.volumes, volumes, strict=True)
        )

    def fit(self, lattice: Lattice) -> Fitted | None:
        """What stands for a lattice that is no polynomial, with the functions of the plan's fit.

        None where the plan has no fit, or not of such a lattice.

        Raises
        ------
        LatticeError
            With these it does not stay within the plan's tolerance.
        """
        mine = self.fitted
        if mine is None or lattice is mine.asked:
            return mine
        if not mine.asked.volume.same_basis(lattice.volumes[0]):
            return None
        nesting = self.origin.soundness.nesting
        return fit_lattice(self.origin.mesh, nesting, lattice, mine.tolerance, mine.fit.cells)

    def with_matrices(self) -> Plan:
        """The same plan for many deformations: each takes a fraction of the time.

        The matrices that take a control net to all control points of surfaces and curves, to
        vertices, and to the derivatives that folds are looked for by, are worked out, which takes
        about as long as some deformations do, and kept: at degree 3 about 40 kB a face
        (:attr:`matrix_bytes`). The check of a result takes as long as ever; leave it out where it
        is not needed. Results are the same to rounding. Only tensor-product lattices have such
        matrices; others are deformed as without.
        """
        pairs = zip(self.models, self.volumes, strict=True)
        models = tuple(model.written_out(volume) for model, volume in pairs)
        return replace(self, geometry=self.geometry.written_out(), models=models)

    @property
    def matrix_bytes(self) -> int:
        """What the matrices of :meth:`with_matrices` take in memory; 0 without them."""
        sums = [model.sums for model in self.models if model.sums is not None]
        return self.geometry.written_bytes + sum(each.bytes for each in sums)

    def deform(
        self,
        lattice: Lattice,
        *,
        tolerance: float | None = None,
        max_degree: int | None = None,
        check: bool = True,
        require_injective: bool = False,
        progress: Progress | None = None,
    ) -> Result:
        """Apply a lattice with the knots of the plan.

        Parameters
        ----------
        lattice, tolerance, max_degree, check, require_injective, progress
            As for :func:`deform`.

        Raises
        ------
        LatticeError
            The lattice has other degrees, knots or another box, or weights for which some surface
            of this plan would have negative ones. Or it has to be injective, and is not.
        CheckError
            The result is no sound solid, as when the lattice folds the model over; or the
            tolerance cannot be met at that degree.
        """
        require_reducible(tolerance, max_degree)
        stage = Stopwatch(progress)
        fitted = self.fitted
        if fitted is not None and lattice is not fitted.asked:
            with stage("fit"):
                fitted = self.fit(lattice)
        lattice = lattice if fitted is None else fitted.lattice
        mesh = self.origin.mesh
        deformation = Deformation.of(lattice, mesh.delta)
        volumes = deformation.volumes
        if not self.fits(volumes):
            raise LatticeError(
                "the plan was prepared for other degrees, knots or another box",
                hint="prepare a plan with this lattice",
            )
        with stage("jacobian"):
            verdict = judge(lattice, self.models)
            if require_injective:
                require_injective_lattice(verdict, mesh, lattice)
        with stage("surfaces", f"{len(self.geometry.parts.patch):,} faces"):
            gaps = self.geometry.gaps.bounds(volumes)
            brep = assemble(self.geometry, volumes, gaps.edges)
        masses: tuple[MassProperties, ...] = ()
        reduced = 0.0
        if tolerance is not None:
            with stage("reduce"):
                brep, reduced = reduce_brep(brep, tolerance, max_degree)
        if check:
            with stage("check"):
                masses = require_sound(brep, verdict)
        warnings = (
            *warnings_of(mesh, self.origin.soundness, lattice, verdict),
            *_untouched(self.geometry.parts, volumes),
        )
        seconds = {**self.seconds, **stage.seconds}
        domain = Domain(
            self.geometry.vertices.rest,
            self.face_polygon,
            deformation,
            None if self.corner is None else face_texture(mesh, self.corner, self.geometry),
        )
        unit = unit_of(mesh, lattice)
        return Result(
            self.origin,
            brep,
            domain,
            unit,
            reduced,
            gaps.deviation,
            verdict,
            seconds,
            warnings,
            checked=check,
            masses=masses,
            fitted=fitted,
        )


def require_injective_lattice(verdict: Injectivity, mesh: Mesh, lattice: Lattice) -> None:
    """Refuse a lattice that folds the mesh over, or of which the contrary is not proved.

    Raises
    ------
    LatticeError
        Says by how much the edits would have to be scaled.
    """
    if verdict.problem is None:
        return
    proved = 0.0 if needs_fit(lattice) else injective_scale(mesh, lattice, most=1.0).proved
    hint = f"scaled by {np.floor(proved * 1000) / 1000:g} or less, the edits are injective"
    raise LatticeError(
        verdict.problem, file=lattice.source.name, hint=hint if proved >= 0.001 else None
    )


def unit_of(mesh: Mesh, lattice: Lattice) -> str:
    """Unit of the numbers: the lattice file's, else the mesh file's, else mm."""
    return lattice.unit or mesh.unit or "mm"


def warnings_of(
    mesh: Mesh, soundness: Soundness, lattice: Lattice, verdict: Injectivity
) -> list[str]:
    """What is to be said of a mesh and a lattice before anything is made of them."""
    folded = [verdict.problem] if verdict.problem else []
    return [*mesh.notes, *describe_remarks(mesh, soundness), *lattice.warnings, *folded]


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
