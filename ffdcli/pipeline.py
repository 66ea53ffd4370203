"""The main path, one screen: mesh and lattice in, exact trimmed surfaces out.

    mesh -> planes -> cut -> regions -> outlines -> patches + curves -> B-rep -> OpenCascade -> file

``prepare`` does all that depends on the mesh and the knots alone; the plan it returns is applied to
as many control nets as one likes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ffdcli.brep.assemble import Geometry, Shells, assemble, deviation_bound, reverse_shells
from ffdcli.brep.occ.formats import CAD_FORMATS, IgesMode, Schema, cad_format, write_cad
from ffdcli.brep.occ.header import FileHeader
from ffdcli.brep.record import Bools, Brep, Floats, Ints
from ffdcli.errors import CheckError, FileError, LatticeError
from ffdcli.mesh import Mesh, ShellNesting, Soundness, inspect, require_usable, triangles
from ffdcli.surface.curves import plan_curves
from ffdcli.surface.flat import find_affine
from ffdcli.surface.graph import fit_graphs, plane_deviation
from ffdcli.surface.outlines import trace_outlines
from ffdcli.surface.partition import Partition, partition
from ffdcli.surface.planes import find_planes, join_parallel
from ffdcli.surface.refine import keep_overshoot_small, keep_weights_positive
from ffdcli.surface.tolerance import Tolerances, kernel_tolerance
from ffdcli.volume.bspline import BSplineVolume

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

Patches = Literal["merged", "bezier"]
Progress = Callable[[str], None]

# Vertices per shell at which the sense of the deformation is sampled.
_SENSE_SAMPLES = 500


def read_lattice(path: str | Path, mesh: Mesh | None = None) -> Lattice:
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
    return lattice.settle(bounds=mesh.bounds, triangles=points, delta=mesh.delta, groups=groups)


def deform(
    mesh: Mesh,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    check: bool = True,
    progress: Progress | None = None,
) -> Result:
    """Bend a mesh with a lattice into exact trimmed surfaces.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Settled by the mesh.
    patches : {"merged", "bezier"}
        One surface per planar region, or the paper's partition into Bézier patches.
    check : bool
        Check topology, volume, and curves against surfaces before the result is handed out.
    progress : callable, optional
        Told the name of each stage as it begins.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    plan = prepare(mesh, lattice, patches=patches, progress=progress)
    return plan.deform(lattice, check=check, progress=progress)


def prepare(
    mesh: Mesh,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    progress: Progress | None = None,
) -> Plan:
    """Do once what depends on the mesh and the knots alone: planes, cuts, outlines, patterns."""
    stage = Stopwatch(progress)
    volume = lattice.volume
    with stage("check mesh"):
        soundness = inspect(mesh)
        require_usable(mesh, soundness)
        corners, polygon = triangles(mesh)
    with stage("planes"):
        local = volume.frame.to_local(mesh.vertices)
        groups = find_planes(local, corners, polygon, mesh.delta)
        if patches == "bezier":
            groups = join_parallel(local, corners, groups, mesh.delta)
        epsilon = plane_deviation(groups, mesh.delta)
        graphs = fit_graphs(local, corners, groups, volume, epsilon)
    with stage("cut"):
        every_knot = patches == "bezier"
        limits = Tolerances(mesh.size, epsilon, kernel_tolerance(mesh.vertices))
        parts = partition(local, corners, groups, graphs, volume, limits, every_knot=every_knot)
        parts = keep_overshoot_small(parts, groups, graphs, volume, limits, shared=every_knot)
        parts, batches = keep_weights_positive(
            parts, groups, graphs, volume, limits, shared=every_knot
        )
    with stage("outlines"):
        flat = graphs.axes[parts.group[parts.patch]][:, 1:]
        outlines = trace_outlines(parts, flat, epsilon)
        shells = _shells(soundness.nesting, polygon, parts)
    with stage("plan"):
        deformed = parts.inside[parts.patch[outlines.edge_regions]]
        deformed &= outlines.edge_regions >= 0
        bent = np.flatnonzero(deformed.any(axis=1))
        geometry = Geometry(
            parts=parts,
            graphs=graphs,
            outlines=outlines,
            patches=batches,
            curves=plan_curves(parts.pieces.vertices, outlines.edges, bent, volume, limits),
            shells=shells,
            model_vertices=mesh.vertices,
        )
    pieces = np.column_stack([polygon[parts.pieces.triangle], parts.region])
    return Plan(
        mesh=mesh,
        soundness=soundness,
        volume=volume,
        geometry=geometry,
        epsilon=epsilon,
        sub_polygons=len(np.unique(pieces, axis=0)),
        seconds=stage.seconds,
    )


@dataclass(frozen=True)
class Plan:
    """A mesh cut for one set of knots, ready for any control net on them.

    Parameters
    ----------
    mesh : Mesh
    soundness : Soundness
    volume : BSplineVolume
        Degrees, knots and frame the plan holds for.
    geometry : Geometry
    epsilon : float, model length
        The run's tolerance for coincidence with planes (design, section 4).
    sub_polygons : int
        Pieces of the input polygons after cutting.
    seconds : dict of str to float
    """

    mesh: Mesh
    soundness: Soundness
    volume: BSplineVolume
    geometry: Geometry
    epsilon: float
    sub_polygons: int
    seconds: dict[str, float]

    def deform(
        self, lattice: Lattice, *, check: bool = True, progress: Progress | None = None
    ) -> Result:
        """Apply a lattice with the knots of the plan.

        Raises
        ------
        LatticeError
            The lattice has other degrees, knots or another box.
        CheckError
            The result is no sound solid, as when the lattice folds the model over.
        """
        volume = lattice.volume
        if not volume.same_basis(self.volume):
            raise LatticeError(
                "the plan was prepared for other degrees, knots or another box",
                hint="prepare a plan with this lattice",
            )
        stage = Stopwatch(progress)
        with stage("surfaces"):
            maps = find_affine(volume, self.geometry.patches, self.geometry.parts)
            brep = assemble(self.geometry, volume, maps)
            brep = reverse_shells(brep, _mirrored(self.geometry, volume))
        if check:
            with stage("check"):
                _require_sound(brep)
        unit = lattice.unit or self.mesh.unit or "mm"
        warnings = (*self.mesh.notes, *_open_edges(self.soundness), *lattice.warnings)
        seconds = {**self.seconds, **stage.seconds}
        deviation = deviation_bound(self.geometry, volume)
        return Result(self, brep, unit, deviation, seconds, warnings)


@dataclass(frozen=True)
class Result:
    """Exact trimmed surfaces of a deformed mesh.

    Parameters
    ----------
    plan : Plan
    brep : Brep
        The boundary representation in integers and arrays.
    unit : str
        Unit of the numbers.
    deviation : float, model length
        Bound of what the mesh's vertices lie off the planes that stand for them, deformed.
    seconds : dict of str to float
    warnings : tuple of str
    output, bytes : str and int, once written
    """

    plan: Plan
    brep: Brep
    unit: str
    deviation: float
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    output: str | None = None
    bytes: int | None = None
    _kernel_shape: list[Any] = field(default_factory=list, repr=False, compare=False)

    @property
    def report(self) -> dict[str, Any]:
        """The report of ``ffd deform --json``."""
        brep, mesh, soundness = self.brep, self.plan.mesh, self.plan.soundness
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
            "sub_polygons": self.plan.sub_polygons,
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
            "epsilon": self.plan.epsilon,
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
                    hint="nothing was written; look for places where the lattice folds the model",
                )
        with stage("write"):
            source = Path(self.plan.mesh.source).name
            size = write_cad(
                shape,
                path,
                unit=unit,
                schema=schema,
                iges_mode=iges_mode,
                name=Path(source).stem,
                header=FileHeader(description=f"{source}, deformed exactly"),
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


class Stopwatch:
    """Seconds of each stage; tells whoever asked when one begins."""

    def __init__(self, progress: Progress | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the enclosed stage."""
        if self._progress is not None:
            self._progress(name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = time.perf_counter() - start


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


def _shells(nesting: ShellNesting, polygon: Ints, parts: Partition) -> Shells:
    """Shells of regions, and solids: an outward-facing body and the cavities inside it."""
    sample = np.zeros(len(parts.patch), dtype=np.int64)
    sample[parts.region] = np.arange(parts.pieces.count)
    solid = np.full(len(nesting.closed), -1, dtype=np.int64)
    outer = np.flatnonzero(nesting.closed & (nesting.parent < 0))
    solid[outer] = np.arange(len(outer))
    cavity = np.flatnonzero(nesting.closed & (nesting.parent >= 0))
    if np.any(cavity < nesting.parent[cavity]):
        # Shells are numbered so that the outer one comes first.
        rank = np.argsort(np.where(nesting.parent >= 0, 1, 0), kind="stable")
        place = np.empty_like(rank)
        place[rank] = np.arange(len(rank))
    else:
        rank = place = np.arange(len(solid))
    solid[cavity] = solid[nesting.parent[cavity]]
    body = nesting.body[polygon[parts.pieces.triangle[sample]]]
    return Shells(place[body], nesting.closed[rank], solid[rank])


def _mirrored(geometry: Geometry, volume: BSplineVolume) -> Bools:
    """Shells that the deformation turns inside out: det J < 0 at most of their vertices."""
    parts = geometry.parts
    owner = parts.pieces.owner
    shell = geometry.shells.region_shell[parts.region[owner]]
    result = np.zeros(len(geometry.shells.closed), dtype=bool)
    order = np.argsort(shell, kind="stable")
    bounds = np.searchsorted(shell[order], np.arange(len(result) + 1))
    for number in range(len(result)):
        corner = order[bounds[number] : bounds[number + 1]]
        step = max(1, len(corner) // _SENSE_SAMPLES)
        points: Floats = parts.pieces.vertices[parts.pieces.corners[corner[::step]]]
        result[number] = bool(np.median(np.linalg.det(volume.jacobian(points))) < 0)
    return result


def _require_sound(brep: Brep) -> None:
    from ffdcli.brep.verify.own import check_brep

    report = check_brep(brep)
    if report.faults:
        raise CheckError(
            "the result failed its own check: " + "; ".join(report.faults),
            hint="nothing was written; look for places where the lattice folds the model",
        )
