"""The result of deforming a CAD part: its report, and the files written from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.occ.formats import (
    UNPAINTED,
    Checks,
    IgesMode,
    Schema,
    Writer,
    cad_format,
    require_writable,
)
from ffdcli.brep.occ.part.mesh import named_mesh
from ffdcli.brep.occ.targets import TargetName, target_named
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.errors import CheckError, KernelError
from ffdcli.folds.verdict import Injectivity
from ffdcli.lattice.fit.report import FitReport, facts_of_fits
from ffdcli.part.deform import DeformedPart
from ffdcli.part.record import Part
from ffdcli.part.surfaces import BSplineSurface, Surface
from ffdcli.part.triangles import join_triangles, measure_triangles, points_at_rest
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.tessellate.mesh_result import (
    DEFAULT_TOLERANCE,
    MeshResult,
    is_closed,
    require_whole,
)

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.mesh import PartTriangles
    from ffdcli.brep.occ.part.write import NewPart

# Share of the tolerance that the mesher is given first, and how often it is halved.
_FIRST, _ROUNDS = 0.75, 4


@dataclass(frozen=True, eq=False)
class PartResult:
    """A deformed CAD part: the topology that was read, with new geometry.

    Parameters
    ----------
    deformed : DeformedPart
    injectivity : Injectivity
        Whether the lattice folds the part over.
    unit : str
        Unit of the numbers.
    seconds : dict of str to float
    warnings : tuple of str
    receiver : str
        Name of the program that files are written for, where `write` names none.
    target : dict
        The choices made for the receiver, once written.
    output, bytes : str and int, or None before `write`
    fits : tuple of FitReport
        What the fits of the lattice reached.
    """

    deformed: DeformedPart
    injectivity: Injectivity
    unit: str
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    receiver: TargetName = "generic"
    target: dict[str, Any] | None = None
    output: str | None = None
    bytes: int | None = None
    fits: tuple[FitReport, ...] = ()

    @property
    def max_error(self) -> float:
        """Measured bound of the deviation of fitted surfaces and curves, model length."""
        return self.deformed.max_error

    @property
    def exact(self) -> bool:
        """Whether nothing was fitted."""
        return self.max_error == 0

    @property
    def report(self) -> dict[str, Any]:
        """The report of ``ffd deform --json``."""
        part, facts = self.deformed.part, self.deformed.report
        return {
            "output": self.output,
            "part": describe_part(part),
            "faces": part.face_count,
            "edges": len(part.edges),
            "vertices": len(part.points),
            "solids": part.solid_count,
            "watertight": bool(part.shell_closed.all()),
            "control_points": facts["control_points"],
            "degrees": dict(sorted(Counter(self.face_kinds).items())),
            "exact": self.exact,
            "max_error": self.max_error,
            "samples": facts["samples"],
            **facts_of_fits(self.fits),
            "faces_by": facts["faces"],
            "edges_by": facts["edges"],
            "largest_tolerance": facts["largest_tolerance"],
            "jacobian": self.injectivity.report,
            "unit": self.unit,
            "target": self.target,
            "bytes": self.bytes,
            "seconds": {name: round(spent, 4) for name, spent in self.seconds.items()},
            "warnings": list(self.warnings),
        }

    @property
    def face_kinds(self) -> tuple[str, ...]:
        """Degrees of each face's surface, the lower first, or its kind."""
        pairs = zip(self.deformed.part.surfaces, self.deformed.surfaces, strict=True)
        return tuple(kind_of(old if new is None else new) for old, new in pairs)

    @cached_property
    def _kernel(self) -> NewPart:
        from ffdcli.brep.occ.part.write import NewPart

        return NewPart(self.deformed.part, self.deformed)

    def triangles(self, tolerance: float) -> tuple[PartTriangles, Floats]:
        """Triangles of the result within a tolerance, and their points (n, 3) before, model length.

        Points before are those of the part as it was read at the same parameters.
        """
        made = self._kernel.triangles(tolerance)
        return made, points_at_rest(self.deformed, made)

    def tessellate(
        self, tolerance: float | None = None, *, progress: Progress | None = None
    ) -> MeshResult:
        """Cut the faces into triangles, which are closed where the part is.

        Parameters
        ----------
        tolerance : float, optional, model length
            Largest distance from the deformed part; 2e-4 of its size by default. It is measured at
            dense samples, not proved; the bound of the fit is added.

        Raises
        ------
        CheckError
            The triangles are not within the tolerance, or not closed.
        """
        part, deformed = self.deformed.part, self.deformed
        allowed = DEFAULT_TOLERANCE * part.size if tolerance is None else tolerance
        closed = bool(part.shell_closed.all())
        stage = Stopwatch(progress)
        with stage("triangles", f"{part.face_count:,} faces"):
            finer = _FIRST * (allowed - self.max_error)
            for _ in range(_ROUNDS if finer > 0 else 0):
                made = self._kernel.triangles(finer)
                deviation = measure_triangles(deformed, made) + self.max_error
                chosen, triangles, face = join_triangles(part.face_shell, made)
                if deviation <= allowed and (is_closed(triangles) or not closed):
                    break
                finer /= 2
            else:
                raise CheckError(
                    f"no triangles were found that are within {allowed:.3g} of the deformed part",
                    hint="give a larger --mesh-tolerance, or a smaller --fit-tolerance",
                )
            points = made.points[chosen]
            if closed:
                require_whole(points, triangles)
            rest = points_at_rest(deformed, made)[chosen]
        return MeshResult(
            mesh=named_mesh(part, rest, triangles, face, self._kernel.colours),
            about={"part": describe_part(part)},
            mode="exact",
            rest=rest,
            points=points,
            triangles=triangles,
            owner=face,
            polygon=np.arange(len(triangles)),
            deviation=deviation,
            tolerance=allowed,
            unit=self.unit,
            seconds={**self.seconds, **stage.seconds},
            warnings=self.warnings,
            facts={
                "faces": part.face_count,
                "faces_by": deformed.report["faces"],
                "max_error": self.max_error,
                **facts_of_fits(self.fits),
                "jacobian": self.injectivity.report,
            },
        )

    @property
    def kernel_shape(self) -> Any:
        """The OpenCascade shape (``TopoDS_Shape``), built on first use."""
        return self._kernel.shape

    @cached_property
    def shape(self) -> Any:
        """The result as a cadquery shape."""
        from ffdcli.brep.occ.building.build import as_cadquery

        return as_cadquery(self.kernel_shape)

    def write(
        self,
        path: str | Path,
        *,
        unit: str | None = None,
        target: TargetName | None = None,
        schema: Schema | None = None,
        iges_mode: IgesMode | None = None,
        writer: Writer = "kernel",
        check: bool | Checks = True,
        progress: Progress | None = None,
    ) -> PartResult:
        """Write a CAD file by its extension, whole or not at all.

        Parameters
        ----------
        path : str or Path
            ``.step``, ``.stp``, ``.iges``, ``.igs`` or ``.brep``.
        unit, target, schema, iges_mode, progress
            As for :meth:`ffdcli.Result.write`.
        writer : {"kernel"}
            OpenCascade alone writes parts with curved faces.
        check : bool or {"own", "kernel"}
            Let OpenCascade check the shape before it is written, and read the file again: all but
            False ask for that.

        Returns
        -------
        PartResult
            The same result; its report now has file name, size and seconds.

        Raises
        ------
        FileError, KernelError, CheckError
        """
        require_writable(path)
        if writer != "kernel":
            raise KernelError(
                f"the writer `{writer}` takes meshes, and parts of planes and straight edges, only",
                hint="use the writer `kernel`",
            )
        unit, part = unit or self.unit, self.deformed.part
        chosen = target_named(target or self.receiver)
        chosen = replace(
            chosen, schema=schema or chosen.schema, iges_mode=iges_mode or chosen.iges_mode
        )
        stage, faces = Stopwatch(progress), f"{part.face_count:,} faces"
        with stage("build", faces):
            kernel = self._kernel
        if check:
            with stage("check", faces):
                self._require_accepted()
        with stage("write", faces):
            source = Path(part.source).name
            how = "exactly" if self.exact else f"within {self.max_error:.2g} {unit}"
            size = kernel.write(
                path,
                unit=unit,
                schema=chosen.schema,
                pcurves=chosen.pcurves,
                iges_mode=chosen.iges_mode,
                header=FileHeader(description=f"{source}, deformed {how}"),
                check=bool(check),
            )
        return replace(
            self,
            unit=unit,
            seconds={**self.seconds, **stage.seconds},
            warnings=(*self.warnings, *self._lost(cad_format(path), chosen.schema)),
            target=chosen.facts(cad_format(path)),
            output=str(path),
            bytes=size,
        )

    def _require_accepted(self) -> None:
        """Reject a result that OpenCascade does not accept, unless the part was no better."""
        verdict, part = self._kernel.check(), self.deformed.part
        why = self.injectivity.problem or "please report it with the files"
        if part.valid:
            verdict.require(bool(part.shell_closed.all()), f"nothing was written; {why}")

    def _lost(self, kind: str | None, schema: Schema) -> list[str]:
        """Warnings about what the part has and the file cannot hold."""
        part = self.deformed.part
        if kind == "BREP" and (
            any((*part.face_names, *part.solid_names)) or any(self._kernel.colours)
        ):
            return ["BREP files have no place for names and colours: they are left out"]
        if kind == "STEP" and schema in UNPAINTED and any(self._kernel.colours):
            return [f"{schema.upper()} has no place for colours: they are left out"]
        return []


def kind_of(surface: Surface) -> str:
    """Degrees of a B-spline surface, the lower first, such as ``2x3``; else its kind."""
    if isinstance(surface, BSplineSurface):
        return "x".join(map(str, sorted(surface.degrees)))
    return surface.kind


def surface_facts(surfaces: Sequence[Surface]) -> dict[str, Any]:
    """Control points, degrees or kinds, and whether any surface has weights."""
    splines = [surface for surface in surfaces if isinstance(surface, BSplineSurface)]
    return {
        "control_points": sum(each.poles[..., 0].size for each in splines),
        "degrees": dict(sorted(Counter(map(kind_of, surfaces)).items())),
        "rational": any(each.weights is not None for each in splines),
    }


def describe_part(part: Part) -> dict[str, Any]:
    """The section ``part`` of reports: faces by kind, edges, bodies, whether it is closed."""
    shells = part.shell_solid
    return {
        "faces": dict(sorted(Counter(surface.kind for surface in part.surfaces).items())),
        "edges": len(part.edges),
        "vertices": len(part.points),
        "bodies": part.solid_count + int((shells < 0).sum()),
        "closed": bool(part.shell_closed.all()),
        "valid": part.valid,
        "largest_tolerance": float(
            max(part.edge_tolerance.max(initial=0.0), part.vertex_tolerance.max(initial=0.0))
        ),
    }
