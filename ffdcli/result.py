"""What a run hands out: the B-rep, its report, and files of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.brep.occ.formats import CAD_FORMATS, IgesMode, Schema, cad_format, write_cad
from ffdcli.brep.occ.header import FileHeader
from ffdcli.brep.record import Brep
from ffdcli.brep.reduce import digits_within
from ffdcli.errors import CheckError, FileError
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
    """Trimmed surfaces of a deformed mesh, exact or within a certified bound.

    Parameters
    ----------
    origin : Origin
    brep : Brep
        The boundary representation in integers and arrays.
    unit : str
        Unit of the numbers.
    max_error : float, model length
        Certified bound of what surfaces and curves are off the exact ones; 0 where exact.
    deviation : float, model length
        Bound of what the mesh's vertices lie off the planes that stand for them, deformed.
    seconds : dict of str to float
    warnings : tuple of str
    output, bytes : str and int, once written
    """

    origin: Origin
    brep: Brep
    unit: str
    max_error: float
    deviation: float
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    output: str | None = None
    bytes: int | None = None
    _kernel_shape: list[Any] = field(default_factory=list, repr=False, compare=False)

    @property
    def exact(self) -> bool:
        """Whether nothing was reduced or fitted."""
        return self.max_error == 0

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
            "exact": self.exact,
            "max_error": self.max_error,
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
        if not self._kernel_shape:
            from ffdcli.brep.occ.build import build_shape

            self._kernel_shape.append(build_shape(self.brep))
        return self._kernel_shape[0]

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
            Have OpenCascade check the shape first.

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
        with stage("load kernel"):
            from ffdcli.brep.occ.check import kernel_check
        with stage("build"):
            shape = self.kernel_shape
        if check:
            with stage("kernel check"):
                verdict = kernel_check(shape)
            if not verdict.valid or verdict.closed != bool(self.brep.shell_closed.all()):
                raise CheckError(
                    "OpenCascade does not accept the result: "
                    + ("; ".join(verdict.faults) or "a shell that should be closed is open"),
                    hint="nothing was written; the lattice may fold the model there",
                )
        with stage("write"):
            source = Path(self.origin.mesh.source).name
            how = "exactly" if self.exact else f"within {self.max_error:.2g} {unit}"
            size = write_cad(
                shape,
                path,
                unit=unit,
                schema=schema,
                iges_mode=iges_mode,
                name=Path(source).stem,
                header=FileHeader(description=f"{source}, deformed {how}"),
                digits=17 if self.exact else digits_within(self.brep, self.max_error),
            )
        seconds = {**self.seconds, **stage.seconds}
        return replace(self, unit=unit, seconds=seconds, output=str(path), bytes=size)


def require_writable(path: str | Path) -> None:
    """Refuse an output whose extension is not known, or whose folder is not there.

    Raises
    ------
    FileError
    """
    path = Path(path)
    if cad_format(path) is None:
        raise FileError(
            f"cannot write a file of kind {path.suffix or 'without an extension'!r}",
            file=str(path),
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    if path.is_dir() or not path.parent.is_dir():
        what = "is a folder" if path.is_dir() else "is in a folder that does not exist"
        raise FileError(f"the output {what}", file=str(path), hint="name a file in a folder")
