"""The plan: all that depends on mesh and knots alone; it turns any control net into a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.brep.assemble import assemble
from ffdcli.brep.geometry import Geometry
from ffdcli.brep.occ.targets import TargetName, target_named
from ffdcli.brep.record import MassProperties
from ffdcli.brep.reduce_options import require_reducible
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError
from ffdcli.folds.model import ModelInBox
from ffdcli.folds.verdict import Injectivity, injective_scale, judge
from ffdcli.forecast import Memory
from ffdcli.mesh import CheckedMesh, Mesh, describe_remarks
from ffdcli.origin import Origin
from ffdcli.result import Result
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.surface.partition import Partition
from ffdcli.tessellate.undeformed import Undeformed
from ffdcli.volume.protocol import LatticeMap, Volume

if TYPE_CHECKING:
    from ffdcli.fitting.lattice_fit import FittedLattice
    from ffdcli.fitting.parametrization import Parametrization
    from ffdcli.lattice import Lattice
    from ffdcli.tessellate.texture import Texture


@dataclass(frozen=True)
class Plan:
    """A mesh cut for one set of knots, ready for any control net on them.

    Parameters
    ----------
    origin : Origin
    volumes : tuple of Volume
        Volumes whose degrees, knots and frames the plan was made for.
    geometry : Geometry
    models : tuple of ModelInBox
        The mesh in the box of each volume, to tell whether it is folded over.
    seconds : dict of str to float
    keeps_texture : bool
        Whether no face joins polygons that have different maps into the texture.
    fitted : FittedLattice or None
        The fitted volumes that replace maps that are not piecewise polynomial.
    parametrization : Parametrization or None
        What it took to find the parameters of the mesh's vertices, where maps need them.
    warnings : tuple of str
        About the cuts.
    for_one_net : bool
        Whether the cuts depend on the control nets that the plan was made for; with others control
        points may be far away.
    memory : Memory or None
        What the work that the plan was made for takes.
    """

    origin: Origin
    volumes: tuple[Volume, ...]
    geometry: Geometry
    models: tuple[ModelInBox, ...]
    seconds: dict[str, float]
    keeps_texture: bool = False
    fitted: FittedLattice | None = None
    parametrization: Parametrization | None = None
    warnings: tuple[str, ...] = ()
    for_one_net: bool = False
    memory: Memory | None = None

    def fits(self, maps: Sequence[LatticeMap]) -> bool:
        """Whether the plan was prepared for as many maps of the same degrees, knots, boxes."""
        return same_bases(self.volumes, maps)

    def serves(self, lattice: Lattice) -> bool:
        """Whether the plan gives what one made for this lattice alone would give.

        Knots and weights are the same; so are the nets where the cuts depend on them.
        """
        if lattice.needs_fit or self.fitted is not None or not self.fits(lattice.maps):
            return False
        first = 0 if self.for_one_net else 3
        return all(
            np.array_equal(made.net[..., first:], asked.net[..., first:])
            for made, asked in zip(self.volumes, lattice.volumes, strict=True)
        )

    def fit(self, lattice: Lattice) -> FittedLattice | None:
        """Fit a lattice that is not piecewise polynomial with the functions of the plan's fit.

        Returns None where the plan has no fit, or one of another lattice.

        Raises
        ------
        LatticeError
            The fit does not stay within the plan's tolerance.
        """
        mine = self.fitted
        if mine is None or lattice is mine.asked:
            return mine
        if not same_bases(mine.asked.maps, lattice.maps):
            return None
        # Only lattices that are not piecewise polynomial need it.
        from ffdcli.fitting.lattice_fit import fit_lattice

        checked = self.origin.checked
        nesting = checked.soundness.nesting
        return fit_lattice(checked.mesh, nesting, lattice, mine.tolerance, mine)

    def with_matrices(self) -> Plan:
        """The same plan with matrices: each further deformation takes a fraction of the time.

        The matrices take a control net to all control points of surfaces and curves, to vertices,
        and to the derivatives that the search for folds needs. Making them takes about as long as
        some deformations; at degree 3 they take about 40 kB a face (:attr:`matrix_bytes`). The
        check of a result takes as long as before: leave it out where it is not needed. Results are
        the same to rounding. Only tensor-product lattices have matrices; others are deformed as
        without.
        """
        pairs = zip(self.models, self.volumes, strict=True)
        models = tuple(model.with_matrices(volume) for model, volume in pairs)
        return replace(self, geometry=self.geometry.with_matrices(), models=models)

    @property
    def matrix_bytes(self) -> int:
        """Memory of the matrices of :meth:`with_matrices`; 0 without them."""
        sums = [model.sums for model in self.models if model.sums is not None]
        return self.geometry.matrix_bytes + sum(each.bytes for each in sums)

    def _texture(self) -> Texture | None:
        """Texture coordinates of the vertices in each face, if faces keep them."""
        if not self.keeps_texture:
            return None
        from ffdcli.tessellate.texture import face_texture

        return face_texture(self.origin.checked, self.geometry)

    def deform(
        self,
        lattice: Lattice,
        *,
        tolerance: float | None = None,
        max_degree: int | None = None,
        target: TargetName = "generic",
        check: bool = True,
        require_injective: bool = False,
        progress: Progress | None = None,
    ) -> Result:
        """Apply a lattice with the knots of the plan.

        Parameters
        ----------
        lattice, tolerance, max_degree, target, check, require_injective, progress
            As for :func:`deform`.

        Raises
        ------
        LatticeError
            The lattice has other degrees, knots or another box, or weights for which some surface
            of this plan would have negative weights. Or it must be injective, and is not.
        CheckError
            The result is not a sound solid, as where the lattice folds the model over; or the
            tolerance cannot be met at that degree.
        """
        require_reducible(tolerance, max_degree)
        max_degree = target_named(target).cap(tolerance, max_degree)
        stage = Stopwatch(progress)
        fitted = self.fitted
        if fitted is not None and lattice is not fitted.asked:
            with stage("fit"):
                fitted = self.fit(lattice)
        lattice = lattice if fitted is None else fitted.lattice
        mesh = self.origin.checked.mesh
        deformation = Deformation.of(lattice, mesh.delta)
        if not self.fits(lattice.maps):
            raise LatticeError(
                "the plan was prepared for other degrees, knots or another box",
                hint="prepare a plan with this lattice",
            )
        volumes, parts = lattice.volumes, self.geometry.parts
        with stage("jacobian"):
            verdict = judge(lattice, self.models)
            if require_injective:
                require_injective_lattice(verdict, mesh, lattice)
        about = "" if self.memory is None else f", {self.memory.text}"
        with stage("surfaces", f"{len(parts.patch):,} faces{about}"):
            gaps = self.geometry.bounds(volumes)
            brep = assemble(self.geometry, volumes, gaps.edges)
        masses: tuple[MassProperties, ...] = ()
        reduced = 0.0
        if tolerance is not None:
            from ffdcli.brep.reduce import reduce_brep

            with stage("reduce"):
                brep, reduced = reduce_brep(brep, tolerance, max_degree)
        if check:
            from ffdcli.brep.evaluate.own_check import require_sound

            with stage("check"):
                masses = require_sound(brep, verdict.hint)
        warnings = (
            *warnings_of(self.origin.checked, lattice, verdict),
            *_untouched(parts, volumes),
            *self.warnings,
        )
        seconds = {**self.seconds, **stage.seconds}
        undeformed = Undeformed(
            self.geometry.vertices.rest,
            self.origin.face_polygon,
            deformation,
            self._texture(),
        )
        unit = unit_of(mesh, lattice)
        return Result(
            self.origin,
            brep,
            undeformed,
            unit,
            reduced,
            gaps.deviation,
            verdict,
            seconds,
            warnings,
            checked=check,
            masses=masses,
            fitted=fitted,
            parametrization=self.parametrization,
            interpolated=gaps.rounding if parts.rectangles is not None else None,
            receiver=target,
            memory=self.memory,
            fits=lattice.fits,
        )


def same_bases(mine: Sequence[LatticeMap], others: Sequence[LatticeMap]) -> bool:
    """Whether maps are as many and of the same degrees, knots and boxes."""
    return len(mine) == len(others) and all(
        one.same_basis(other) for one, other in zip(mine, others, strict=True)
    )


def require_injective_lattice(verdict: Injectivity, mesh: Mesh, lattice: Lattice) -> None:
    """Reject a lattice that folds the mesh over, or that is not proved not to.

    Raises
    ------
    LatticeError
        With the largest scale of the edits that is proved injective.
    """
    if verdict.problem is None:
        return
    proved = 0.0 if lattice.needs_fit else injective_scale(mesh, lattice, most=1.0).proved
    hint = f"scaled by {np.floor(proved * 1000) / 1000:g} or less, the edits are injective"
    raise LatticeError(
        verdict.problem, file=lattice.source.name, hint=hint if proved >= 0.001 else None
    )


def unit_of(mesh: Mesh, lattice: Lattice) -> str:
    """Unit of the numbers: the lattice file's, else the mesh file's, else mm."""
    return lattice.unit or mesh.unit or "mm"


def warnings_of(checked: CheckedMesh, lattice: Lattice, verdict: Injectivity) -> list[str]:
    """Warnings about a mesh, a lattice and what it does to the mesh."""
    mesh, soundness = checked.mesh, checked.soundness
    folded = [verdict.problem] if verdict.problem else []
    return [*mesh.notes, *describe_remarks(mesh, soundness), *lattice.warnings, *folded]


def _untouched(parts: Partition, volumes: Sequence[Volume]) -> list[str]:
    """Warn of every lattice box that no part of the mesh's surface lies in."""
    warnings = []
    for number, volume in enumerate(volumes):
        used = parts.pieces.vertices[parts.pieces.corners, number]
        beside = (used.min(axis=0) > volume.box[1]) | (used.max(axis=0) < volume.box[0])
        if not ((parts.zone == number).any() or beside.any()):
            which = f"lattices[{number}]: " if len(volumes) > 1 else ""
            said = "no part of the mesh's surface lies in the lattice box: nothing is deformed"
            warnings.append(which + said)
    return warnings
