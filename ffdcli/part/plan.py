"""A CAD part prepared once for lattices of one basis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ffdcli.brep.occ.part.mesh import mesh_of_part
from ffdcli.brep.occ.targets import TargetName, target_named
from ffdcli.errors import LatticeError, MeshError
from ffdcli.folds.model import ModelInBox, place_in_each
from ffdcli.folds.verdict import Injectivity, judge
from ffdcli.mesh import Mesh, inspect
from ffdcli.part.deform import DEFAULT_TOLERANCE, begin_with_knots, count_kinds, deform_part
from ffdcli.part.prepared import PreparedPart
from ffdcli.part.record import Part
from ffdcli.part.result import PartResult
from ffdcli.plan import require_injective_lattice, same_bases
from ffdcli.stopwatch import Progress, Stopwatch

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice


@dataclass(frozen=True, eq=False)
class PartPlan:
    """A CAD part prepared for lattices of one basis, ready for any control net.

    Kept are samples of faces and edges, the places of knot planes on them, and the triangles on
    which folds are looked for. Unless the plan was made for one lattice alone, fits begin with the
    knots that its lattice needed: then they take a fraction of the time, and may have more control
    points than a lattice that does less would need.

    Parameters
    ----------
    prepared : PreparedPart
    members : tuple of BoxLattice
        Boxes that the plan was made for.
    mesh : Mesh
        Triangles of the part.
    models : tuple of ModelInBox
        These in each box, to tell whether the part is folded over.
    fit_tolerance : float or None, model length
    seconds : dict of str to float
    """

    prepared: PreparedPart
    members: tuple[BoxLattice, ...]
    mesh: Mesh
    models: tuple[ModelInBox, ...]
    fit_tolerance: float | None
    seconds: dict[str, float]

    @property
    def part(self) -> Part:
        """The part as it was read."""
        return self.prepared.part

    def serves(self, lattice: Lattice) -> bool:
        """Whether the boxes have the degrees, knots, frames and locked sides of the plan's."""
        return same_bases([one.map for one in self.members], lattice.maps) and all(
            mine.crossed == other.crossed
            for mine, other in zip(self.members, lattice.members, strict=True)
        )

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
    ) -> PartResult:
        """Apply a lattice of the plan's basis.

        Parameters
        ----------
        lattice, max_degree, target, require_injective, progress
            As for :func:`ffdcli.deform`.
        tolerance : float, optional, model length
            Of fits, where the plan has none.
        check : bool
            Has no effect: parts are checked when they are written.

        Raises
        ------
        LatticeError
            The lattice has another basis. Or it must be injective, and is not.
        CheckError
            A face or edge cannot be fitted within the tolerance.
        """
        stage = Stopwatch(progress)
        with stage("jacobian"):
            verdict = self.judge(lattice)
            if require_injective:
                require_injective_lattice(verdict, self.mesh, lattice)
        with stage("surfaces", f"{self.part.face_count:,} faces"):
            most = target_named(target).max_degree if max_degree is None else max_degree
            deformed = deform_part(self.prepared, lattice, self.fit_tolerance or tolerance, most)
        return PartResult(
            deformed,
            verdict,
            self.unit_of(lattice),
            {**self.seconds, **stage.seconds},
            self.warnings(lattice, verdict),
            receiver=target,
            fits=lattice.fits,
        )

    @property
    def tolerance(self) -> float:
        """Tolerance of fits where :meth:`deform` is given none, model length."""
        return self.fit_tolerance or DEFAULT_TOLERANCE * self.part.size

    def unit_of(self, lattice: Lattice) -> str:
        """Unit of the numbers: the lattice file's, else the part's, else mm."""
        return lattice.unit or self.part.unit or "mm"

    def shares(
        self, lattice: Lattice, *, target: TargetName = "generic"
    ) -> dict[str, dict[str, int]]:
        """Numbers of faces and edges by how :meth:`deform` will make them; nothing is fitted."""
        most = target_named(target).max_degree
        return count_kinds(self.prepared, lattice, self.fit_tolerance, most)

    def judge(self, lattice: Lattice) -> Injectivity:
        """Whether a lattice of the plan's basis folds the part over.

        Raises
        ------
        LatticeError
            The lattice has another basis.
        """
        if not self.serves(lattice):
            raise LatticeError(
                "the plan was prepared for other degrees, knots, borders or another box",
                hint="prepare a plan with this lattice",
            )
        return judge(lattice, self.models)

    def warnings(self, lattice: Lattice, verdict: Injectivity) -> tuple[str, ...]:
        """Warnings about the part, a lattice and what it does to the part."""
        folded = [verdict.problem] if verdict.problem else []
        return (*self.part.notes, *lattice.warnings, *folded)


def plan_part(
    part: Part,
    lattice: Lattice,
    fit_tolerance: float | None,
    *,
    unused: dict[str, bool],
    require_solid: bool,
    once: bool,
    progress: Progress | None,
) -> PartPlan:
    """Prepare a part.

    Parameters
    ----------
    part, lattice, fit_tolerance, require_solid, once, progress
        As for :func:`ffdcli.prepare`.
    unused : dict of str to bool
        Options that parts with curved faces have no use for, and whether they are given.

    Raises
    ------
    MeshError
        The part must be a closed solid, and is not; or an option is given in vain.
    LatticeError, CheckError
        Faces or edges cannot be fitted within the tolerance.
    """
    for name in (name for name, given in unused.items() if given):
        hint = "remove it: parts with curved faces have no use for it"
        raise MeshError(f"the option `{name}` is for planes", file=part.source, hint=hint)
    if require_solid and not (part.shell_closed.all() and part.solid_count):
        raise MeshError("the part is not a closed solid", file=part.source)
    stage = Stopwatch(progress)
    with stage("triangles"):
        mesh = mesh_of_part(part)
        models = tuple(place_in_each(mesh, inspect(mesh).nesting, lattice.maps))
    prepared = PreparedPart(part)
    if not once:
        with stage("knots", f"{part.face_count:,} faces"):
            begin_with_knots(prepared, lattice, fit_tolerance)
    return PartPlan(prepared, lattice.members, mesh, models, fit_tolerance, stage.seconds)
