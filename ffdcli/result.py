"""What a run hands out: the B-rep, its report, and files of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.brep.occ.formats import IgesMode, Schema, require_writable
from ffdcli.brep.occ.header import FileHeader
from ffdcli.brep.occ.kernel import Kernel, LocalKernel
from ffdcli.brep.record import Brep
from ffdcli.errors import CheckError
from ffdcli.mesh import Mesh, Soundness
from ffdcli.stopwatch import Progress, Stopwatch


@dataclass(frozen=True)
class Origin:
    """What a result was made from.

    Parameters
    ----------
    mesh : Mesh
    soundness : Soundness
    epsilon : float, model length
        The run's tolerance for what is straight and flat (design, section 4).
    sub_polygons : int
        Pieces of the input polygons after cutting.
    """

    mesh: Mesh
    soundness: Soundness
    epsilon: float
    sub_polygons: int


@dataclass(frozen=True)
class Result:
    """Exact trimmed surfaces of a deformed mesh.

    Parameters
    ----------
    origin : Origin
    brep : Brep
        The boundary representation in integers and arrays.
    unit : str
        Unit of the numbers.
    deviation : float, model length
        Bound of what the mesh's vertices lie off the planes that stand for them, deformed.
    seconds : dict of str to float
    warnings : tuple of str
    checked : bool
        Our own check has passed.
    output, bytes : str and int, once written
    """

    origin: Origin
    brep: Brep
    unit: str
    deviation: float
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    checked: bool = False
    output: str | None = None
    bytes: int | None = None
    _kernel: LocalKernel = field(default_factory=LocalKernel, repr=False, compare=False)

    @property
    def report(self) -> dict[str, Any]:
        """The report of ``ffd deform --json``."""
        brep, mesh, soundness = self.brep, self.origin.mesh, self.origin.soundness
        degrees: dict[str, int] = {}
        control_points = 0
        for batch in brep.surfaces:
            name = "x".join(str(degree) for degree in sorted(batch.degrees))
            degrees[name] = degrees.get(name, 0) + len(batch.surfaces)
            control_points += len(batch.surfaces) * batch.poles.shape[1] * batch.poles.shape[2]
        planes = len(brep.planes.surfaces)
        if planes:
            degrees["plane"] = planes
        return {
            "output": self.output,
            "mesh": {
                "vertices": len(np.unique(mesh.corners)),
                "polygons": mesh.polygon_count,
                "bodies": soundness.bodies,
                "closed": soundness.closed,
            },
            "sub_polygons": self.origin.sub_polygons,
            "patches": planes + sum(len(batch.surfaces) for batch in brep.surfaces),
            "faces": brep.face_count,
            "edges": len(brep.edges),
            "vertices": len(brep.points),
            "solids": brep.solid_count,
            "watertight": bool(brep.shell_closed.all()),
            "control_points": control_points,
            "degrees": dict(sorted(degrees.items())),
            "rational": any(batch.poles.shape[-1] == 4 for batch in brep.surfaces),
            "exact": True,
            "max_error": 0.0,
            "plane_deviation": self.deviation,
            "epsilon": self.origin.epsilon,
            "unit": self.unit,
            "bytes": self.bytes,
            "seconds": {name: round(spent, 4) for name, spent in self.seconds.items()},
            "warnings": list(self.warnings),
        }

    @property
    def kernel_shape(self) -> Any:
        """The OpenCascade shape (``TopoDS_Shape``), built on first use."""
        self._kernel.build(self.brep)
        return self._kernel.shape

    @cached_property
    def shape(self) -> Any:
        """The result as a cadquery shape."""
        from ffdcli.brep.occ.build import as_cadquery

        return as_cadquery(self.kernel_shape)

    def write(
        self,
        path: str | Path,
        *,
        unit: str | None = None,
        schema: Schema = "ap214",
        iges_mode: IgesMode = "brep",
        check: bool = True,
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
        schema : {"ap203", "ap214", "ap242"}
            For STEP.
        iges_mode : {"brep", "faces"}
            For IGES: solids (entity 186), or trimmed surfaces (144).
        check : bool
            Have OpenCascade check the shape first, and check it by our own arithmetic where that
            has not been done.
        progress : callable, optional
            Told the name of each stage as it begins.
        kernel : Kernel, optional
            OpenCascade in a process of its own; see :mod:`ffdcli.brep.occ.process`. By default
            this process works with it.

        Returns
        -------
        Result
            The same, its report completed by file name, size and seconds.

        Raises
        ------
        FileError, KernelError, CheckError
        """
        require_writable(path)
        unit = unit or self.unit
        stage = Stopwatch(progress)
        if kernel is None:
            kernel = self._kernel
        with stage("load kernel"):
            kernel.load()
        faces = f"{self.brep.face_count:,} faces"
        with stage("build", faces):
            kernel.build(self.brep)
        if check:
            verdict_of = kernel.begin_check()
            if not self.checked:
                with stage("check", faces):
                    require_sound(self.brep)
            with stage("kernel check", faces):
                verdict = verdict_of()
            if not verdict.valid or verdict.closed != bool(self.brep.shell_closed.all()):
                raise CheckError(
                    "OpenCascade does not accept the result: "
                    + ("; ".join(verdict.faults) or "a shell that should be closed is open"),
                    hint="nothing was written; the lattice may fold the model there",
                )
        with stage("write", faces):
            source = Path(self.origin.mesh.source).name
            size = kernel.write(
                path,
                unit=unit,
                schema=schema,
                iges_mode=iges_mode,
                name=Path(source).stem,
                header=FileHeader(description=f"{source}, deformed exactly"),
            )
        seconds = {**self.seconds, **stage.seconds}
        return replace(
            self,
            checked=self.checked or check,
            unit=unit,
            seconds=seconds,
            output=str(path),
            bytes=size,
        )


def require_sound(brep: Brep) -> None:
    """Check a B-rep by our own arithmetic.

    Raises
    ------
    CheckError
        It is no sound solid or shell.
    """
    from ffdcli.brep.verify.own import check_brep

    report = check_brep(brep)
    if report.faults:
        raise CheckError(
            "the result failed its own check: " + "; ".join(report.faults),
            hint="nothing was written; the lattice may fold the model there",
        )
