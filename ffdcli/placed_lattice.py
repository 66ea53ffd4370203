"""Lattice files, read and settled by the mesh or part that they deform."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np

from ffdcli.mesh import Mesh, inspect, require_usable, smallest_box, triangulate

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice, LatticeFile
    from ffdcli.part.record import Part


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
    if mesh is None:
        return lattice
    bounds, delta = mesh.bounds, mesh.delta
    if not isinstance(mesh, Mesh):
        from ffdcli.brep.occ.part.mesh import mesh_of_part

        mesh = mesh_of_part(mesh)
    # Polygons that cross themselves are refused, with all other faults, when faces are made.
    corners, polygon, _ = triangulate(mesh.vertices, mesh.corners, mesh.starts)
    if not len(corners):
        require_usable(mesh, inspect(mesh))
    points = mesh.vertices[corners]
    groups = {name: points[np.isin(polygon, members)] for name, members in mesh.groups.items()}
    return lattice.settle(
        bounds=bounds,
        triangles=points,
        delta=delta,
        groups=groups,
        smallest_box=smallest_box,
    )
