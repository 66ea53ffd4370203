"""Meshes and CAD parts by their files, and the lattices that they settle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ffdcli.brep.occ.formats import CAD_FORMATS, cad_format
from ffdcli.errors import FileError
from ffdcli.mesh import (
    Mesh,
    inspect,
    read_mesh,
    require_usable,
    smallest_box,
    triangulate,
)
from ffdcli.mesh.io.read import DECODERS

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice, LatticeFile
    from ffdcli.part.record import Part
    from ffdcli.verify import Verification


def read_model(path: str | Path, *, repair: bool = False) -> Mesh | Part:
    """Read a CAD part (.step, .stp, .iges, .igs, .brep) or a polygon mesh, by the extension.

    Parameters
    ----------
    path : str or Path
    repair : bool
        Repair a mesh. Parts are refused with it; what OpenCascade's reader repairs in them is said
        in any case.

    Raises
    ------
    FileError, MeshError
    """
    if cad_format(path) is not None:
        if repair:
            raise FileError(
                "`--repair` is for meshes: it repairs no CAD part",
                file=str(path),
                hint="leave it out, and mend the part in the program that made it",
            )
        from ffdcli.brep.occ.part.read import read_part

        return read_part(path)
    suffix = Path(path).suffix.lower()
    if suffix not in DECODERS:
        raise FileError(
            f"cannot tell the format: {repr(suffix) if suffix else 'no extension'} is neither that "
            "of a mesh nor that of a CAD part known here",
            file=str(path),
            hint=f"use {', '.join(CAD_FORMATS)} or {', '.join(DECODERS)}; most CAD programs write "
            "STEP",
        )
    return read_mesh(path, repair=repair)


def as_mesh(model: Mesh | Part) -> Mesh:
    """The mesh itself, or triangles of a part: exact of polyhedra, else near its faces."""
    if isinstance(model, Mesh):
        return model
    # Only parts need these libraries.
    from ffdcli.brep.occ.part.mesh import mesh_of_part

    return mesh_of_part(model)


def verify_model(
    path: str | Path,
    model: Mesh | Part,
    lattice: Lattice,
    *,
    tolerance: float | None = None,
    stated: Any = None,
    source: str | Path = "report",
    unit: str | None = None,
) -> Verification:
    """Re-read a CAD file and compare it with a deformed mesh or CAD part.

    Parameters
    ----------
    path : str or Path
    model : Mesh or Part
        Parts of planes and straight edges are compared as meshes.
    lattice : Lattice
        Settled with the model.
    tolerance : float, optional, model length
        Largest deviation allowed; by default what the report states, or else the default of
        :func:`ffdcli.verify.file.verify_file` or :func:`ffdcli.verify.part.file.verify_part_file`.
    stated : optional
        Report of the run that wrote the file.
    source : str or Path
        File of the report, for messages.
    unit : str, optional
        Unit that the file must state.

    Raises
    ------
    FileError, KernelError
        The file cannot be read, or ``stated`` is no report of ``ffd deform``.
    """
    from ffdcli.verify.file import allowed_deviation, verify_file
    from ffdcli.verify.part.file import verify_part_file
    from ffdcli.verify.regions import fit_bounds

    expected_error, bounds = 0.0, dict[int, float]()
    if stated is not None:
        if tolerance is None:
            tolerance, bounds = allowed_deviation(stated, source, model), fit_bounds(stated)
        expected_error = min(stated["max_error"], tolerance)
    if not isinstance(model, Mesh) and not model.polyhedral:
        return verify_part_file(path, model, lattice, tolerance=tolerance, unit=unit)
    return verify_file(
        path,
        as_mesh(model),
        lattice,
        tolerance=tolerance,
        expected_error=expected_error,
        bounds=bounds,
        unit=unit,
    )


@overload
def read_lattice(path: str | Path, mesh: Mesh | Part) -> Lattice: ...


@overload
def read_lattice(path: str | Path, mesh: None = None) -> LatticeFile: ...


def read_lattice(path: str | Path, mesh: Mesh | Part | None = None) -> Lattice | LatticeFile:
    """Read a lattice file; the mesh or part settles its automatic box and its locked borders.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh or Part, optional
        Without it the result can be inspected, but deforms nothing.

    Raises
    ------
    FileError, LatticeError
        Naming file, line and key.
    MeshError
        All polygons of the mesh cross themselves.
    """
    from ffdcli.lattice import load_lattice

    lattice = load_lattice(path)
    return lattice if mesh is None else settle_lattice(lattice, mesh)


def settle_lattice(lattice: LatticeFile, mesh: Mesh | Part) -> Lattice:
    """The lattice of a file, with the automatic box and the locked borders that a model gives it.

    Raises
    ------
    LatticeError
        Naming file, line and key.
    MeshError
        All polygons of the mesh cross themselves.
    """
    return lattice.settle(**settling_facts(mesh))


def settling_facts(mesh: Mesh | Part) -> dict[str, Any]:
    """The facts of a model that settle a lattice: arguments of :meth:`LatticeFile.settle`.

    Raises
    ------
    MeshError
        All polygons of the mesh cross themselves.
    """
    bounds, delta = mesh.bounds, mesh.delta
    mesh = as_mesh(mesh)
    # Polygons that cross themselves are refused, with all other faults, when faces are made.
    corners, polygon, _ = triangulate(mesh.vertices, mesh.corners, mesh.starts)
    if not len(corners):
        require_usable(mesh, inspect(mesh))
    points = mesh.vertices[corners]
    groups = {name: points[np.isin(polygon, members)] for name, members in mesh.groups.items()}
    return {
        "bounds": bounds,
        "triangles": points,
        "delta": delta,
        "groups": groups,
        "smallest_box": smallest_box,
    }
