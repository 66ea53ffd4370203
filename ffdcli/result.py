"""The result of a run: its B-rep, its report, and the files written from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.brep.labels import doubtful_masses, label_shape, lost_colours
from ffdcli.brep.occ.formats import (
    Checks,
    IgesMode,
    Schema,
    Writer,
    cad_format,
    require_writable,
    require_writer,
)
from ffdcli.brep.occ.processes.kernel import Kernel, LocalKernel
from ffdcli.brep.occ.targets import TargetName, target_named
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.iges import changed_names
from ffdcli.brep.occ.writing.short_edges import require_kept_edges
from ffdcli.brep.record import Brep, MassProperties
from ffdcli.folds.verdict import Injectivity
from ffdcli.forecast import Memory, Work, count_made, require_memory
from ffdcli.lattice.fit.report import FitReport, facts_of_fits
from ffdcli.mesh import describe
from ffdcli.origin import Origin
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.tessellate.undeformed import Undeformed

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict
    from ffdcli.fitting.lattice_fit import FittedLattice
    from ffdcli.fitting.parametrization import Parametrization
    from ffdcli.tessellate.mesh_result import MeshResult


@dataclass(frozen=True)
class Result:
    """Trimmed surfaces of a deformed mesh, exact or within a certified bound.

    Parameters
    ----------
    origin : Origin
    brep : Brep
        The boundary representation in integers and arrays.
    undeformed : Undeformed
        The undeformed vertices, and the deformation, for triangles of the surfaces.
    unit : str
        Unit of the numbers.
    reduced : float, model length
        Certified bound of the deviation that reduction added; 0 where nothing was reduced.
    deviation : float, model length
        Bound of the distance of deformed vertices from their deformed planes.
    injectivity : Injectivity
        Whether the lattice folds the model over.
    seconds : dict of str to float
    warnings : tuple of str
    checked : bool
        Whether our own check has passed.
    masses : tuple of MassProperties
        Of every solid; empty where the result was not checked.
    fitted : FittedLattice or None
        How the lattice was fitted, where that was needed.
    parametrization : Parametrization or None
        What it took to find the parameters of the mesh's vertices, where that was needed.
    interpolated : float or None, model length
        Bound of the rounding errors of surfaces that were interpolated (`paper`).
    receiver : str
        Name of the program that files are written for, where `write` names none.
    target : dict
        The choices made for the receiver, once written.
    output, bytes : str and int, or None before `write`
    memory : Memory or None
        What the run takes and can have.
    fits : tuple of FitReport
        What the fits of the lattice reached.
    """

    origin: Origin
    brep: Brep
    undeformed: Undeformed
    unit: str
    reduced: float
    deviation: float
    injectivity: Injectivity
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    checked: bool = False
    masses: tuple[MassProperties, ...] = ()
    fitted: FittedLattice | None = None
    parametrization: Parametrization | None = None
    interpolated: float | None = None
    receiver: TargetName = "generic"
    target: dict[str, Any] | None = None
    output: str | None = None
    bytes: int | None = None
    memory: Memory | None = None
    fits: tuple[FitReport, ...] = ()
    _kernel: LocalKernel = field(default_factory=LocalKernel, repr=False, compare=False)

    @property
    def max_error(self) -> float:
        """Bound of the deviation of surfaces and curves, model length; 0 if exact.

        The certified bound of the reduction plus the measured bound of the fit.
        """
        return self.reduced + (0.0 if self.fitted is None else self.fitted.bound)

    @property
    def exact(self) -> bool:
        """Whether nothing was reduced, fitted or flattened."""
        return self.max_error == 0 and not self.origin.flattened

    @property
    def report(self) -> dict[str, Any]:
        """The report of ``ffd deform --json``."""
        brep, checked = self.brep, self.origin.checked
        return {
            "output": self.output,
            "mesh": describe(checked.mesh, checked.soundness),
            "sub_polygons": self.origin.sub_polygons,
            "patches": brep.surface_count,
            "faces": brep.face_count,
            "edges": len(brep.edges),
            "vertices": len(brep.points),
            "solids": brep.solid_count,
            "watertight": bool(brep.shell_closed.all()),
            **brep.surface_facts,
            "exact": self.exact,
            "max_error": self.max_error,
            **self._fit_facts,
            **facts_of_fits(self.fits),
            **({} if self.interpolated is None else {"interpolation_error": self.interpolated}),
            "flattened": self.origin.flattened,
            "plane_deviation": self.deviation,
            "epsilon": self.origin.epsilon,
            "jacobian": self.injectivity.report,
            "unit": self.unit,
            "target": self.target,
            "bytes": self.bytes,
            **({} if self.memory is None else {"memory": self.memory.report}),
            "seconds": {name: round(spent, 4) for name, spent in self.seconds.items()},
            "warnings": list(self.warnings),
        }

    @property
    def _fit_facts(self) -> dict[str, Any]:
        """The sections of the report on what was fitted; none where nothing was."""
        spent = self.parametrization
        if self.fitted is None or spent is None:
            return {}
        return {"fit": self.fitted.report, "parametrization": spent.report}

    @property
    def kernel_shape(self) -> Any:
        """The OpenCascade shape (``TopoDS_Shape``), built on first use."""
        self._kernel.build(self.brep)
        return self._kernel.shape

    @cached_property
    def shape(self) -> Any:
        """The result as a cadquery shape."""
        from ffdcli.brep.occ.building.build import as_cadquery

        return as_cadquery(self.kernel_shape)

    def tessellate(
        self, tolerance: float | None = None, *, progress: Progress | None = None
    ) -> MeshResult:
        """Cut the exact surfaces into triangles that conform, and are closed where the mesh is.

        Parameters
        ----------
        tolerance : float, optional, model length
            Largest distance from the exact surfaces; 2e-4 of the mesh's size by default.
            It is measured at dense samples, not proved; the report states the largest found.

        Raises
        ------
        CheckError
            Too many triangles are needed, or the outline of a face crosses itself.
        """
        from ffdcli.tessellate.mesh_result import DEFAULT_TOLERANCE, MeshResult, require_whole
        from ffdcli.tessellate.outlines import net_of_faces
        from ffdcli.tessellate.refine import refine_adaptively
        from ffdcli.tessellate.texture import carry, lost_texture

        mesh, soundness = self.origin.checked.mesh, self.origin.checked.soundness
        allowed = DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance
        stage = Stopwatch(progress)
        with stage("triangles"):
            net = net_of_faces(self.brep, self.undeformed.rest)
            done = refine_adaptively(net, self.undeformed.deformation, allowed)
            triangles = done.net.triangles
            texture = self.undeformed.texture
            uv = None if texture is None else carry(texture, done.net, triangles)
            if soundness.closed:
                require_whole(done.points, triangles)
        return MeshResult(
            mesh=mesh,
            about={"mesh": describe(mesh, soundness)},
            mode="exact",
            rest=done.net.rest,
            points=done.points,
            triangles=triangles,
            owner=done.net.owner,
            polygon=self.undeformed.polygon[done.net.owner],
            deviation=done.deviation,
            tolerance=allowed,
            unit=self.unit,
            seconds={**self.seconds, **stage.seconds},
            warnings=(*self.warnings, *lost_texture(mesh, texture)),
            uv=uv,
            facts={
                "faces": self.brep.face_count,
                **self._fit_facts,
                **facts_of_fits(self.fits),
                "plane_deviation": self.deviation,
                "epsilon": self.origin.epsilon,
                "jacobian": self.injectivity.report,
            },
        )

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
        kernel: Kernel | None = None,
    ) -> Result:
        """Write a CAD file by its extension, whole or not at all.

        Parameters
        ----------
        path : str or Path
            ``.step``, ``.stp``, ``.iges``, ``.igs`` or ``.brep``.
        unit : str, optional
            Unit for the header; by default that of the lattice file, of the mesh file, or mm.
            BREP files have no place for it.
        target : {"generic", "solidworks", "catia", "nx", "fusion", "rhino"}, optional
            The receiver, by default that of :func:`deform`; it settles what is not given
            (`brep.occ.targets`).
        schema : {"ap203", "ap214", "ap242"}, optional
            For STEP. AP203 has no place for colours.
        iges_mode : {"brep", "faces"}, optional
            For IGES: solids (entity 186), or trimmed surfaces (144).
        writer : {"kernel", "direct"}
            OpenCascade; or, for STEP, the same content straight from the arrays, without it.
        check : bool or {"own", "kernel"}
            `own`: check the shape by our own arithmetic where that has not been done yet.
            `kernel`: let OpenCascade check it too. True: `own` for `direct`, else `kernel`.
        progress : callable, optional
            Called with the name of each stage as it begins.
        kernel : Kernel, optional
            OpenCascade in a process of its own; see `brep.occ.processes`. By default this
            process works with it.

        Returns
        -------
        Result
            The same result; its report now has file name, size and seconds.

        Raises
        ------
        FileError, KernelError, CheckError, MemoryLimitError
        """
        require_writable(path)
        require_writer(path, writer)
        work = Work.writing(path, writer, check)
        maps, triangles = self.undeformed.deformation.maps, len(self.origin.checked.triangles)
        memory = require_memory(work, count_made(self.brep, maps, triangles))
        unit = unit or self.unit
        chosen = target_named(target or self.receiver)
        chosen = replace(
            chosen, schema=schema or chosen.schema, iges_mode=iges_mode or chosen.iges_mode
        )
        stage = Stopwatch(progress)
        kernel = kernel or self._kernel
        if writer == "direct":
            # It alone needs the library that prints numbers.
            from ffdcli.brep.step.direct import DirectWriter

            kernel = DirectWriter(self.brep, kernel if work.judged else None)
        faces = f"{self.brep.face_count:,} faces, {memory.text}"
        if work.judged or writer == "kernel":
            with stage("load kernel"):
                kernel.load()
            with stage("build", faces):
                kernel.build(self.brep)
        masses = self.masses
        if check:
            if cad_format(path) == "STEP":
                require_kept_edges(self.brep)
            if work.judged:
                kernel.begin_check()
            if not self.checked:
                from ffdcli.brep.evaluate.own_check import require_sound

                with stage("check", faces):
                    masses = require_sound(self.brep, self.injectivity.hint)
        digits = 17
        if self.reduced > 0:
            from ffdcli.brep.reduce import digits_within

            digits = digits_within(self.brep, self.reduced)
        with stage("write", faces):
            source = Path(self.origin.checked.mesh.source).name
            labels = label_shape(self.brep, Path(source).stem, self.origin.faces, masses)
            off = self.max_error + self.origin.flattened * self.deviation
            how = "exactly" if self.exact else f"within {off:.2g} {unit}"
            size = kernel.write(
                path,
                agree=self._agree if work.judged else None,
                unit=unit,
                schema=chosen.schema,
                pcurves=chosen.pcurves,
                iges_mode=chosen.iges_mode,
                labels=labels,
                header=FileHeader(description=f"{source}, deformed {how}"),
                digits=digits,
            )
        return replace(
            self,
            checked=self.checked or bool(check),
            masses=masses,
            unit=unit,
            seconds={**self.seconds, **stage.seconds},
            warnings=(
                *self.warnings,
                *lost_colours(self.origin.faces, cad_format(path), chosen.schema),
                *(changed_names(labels) if cad_format(path) == "IGES" else ()),
                *(doubtful_masses(masses) if cad_format(path) == "STEP" else ()),
            ),
            target=chosen.facts(cad_format(path)),
            output=str(path),
            bytes=size,
            memory=memory,
        )

    def _agree(self, verdict: KernelVerdict) -> None:
        verdict.require(bool(self.brep.shell_closed.all()), self.injectivity.hint)
