"""The main path, one screen: mesh and lattice in, exact trimmed surfaces out.

    mesh -> planes -> cut -> regions -> outlines -> patches + curves -> B-rep (-> reduced) ->
    OpenCascade -> file

``prepare`` does all that depends on the mesh and the knots alone; the plan it returns is applied to
as many control nets as one likes.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from ffdcli.brep.reduce import require_reducible
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError
from ffdcli.folds.model import place_in_each
from ffdcli.folds.verdict import judge
from ffdcli.formats import Subdivision
from ffdcli.mesh import (
    Mesh,
    corner_triangles,
    inspect,
    require_closed,
    require_usable,
    smallest_box,
    triangulate,
)
from ffdcli.mesh.charts import find_charts
from ffdcli.plan import (
    Kept,
    Patches,
    Plan,
    prepare,
    require_injective_lattice,
    unit_of,
    warnings_of,
)
from ffdcli.result import Result
from ffdcli.stopwatch import Progress, Stopwatch
from ffdcli.tessellate.result import (
    DEFAULT_TOLERANCE,
    MeshResult,
    mirrored_bodies,
    require_whole,
    subdivide,
)
from ffdcli.tessellate.texture import carry, texture_of

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice, LatticeFile

__all__ = ["Kept", "Patches", "Plan", "deform", "deform_mesh", "prepare", "read_lattice"]

KEPT: tuple[Kept, ...] = ("names", "texture")


@overload
def read_lattice(path: str | Path, mesh: Mesh) -> Lattice: ...


@overload
def read_lattice(path: str | Path, mesh: None = None) -> LatticeFile: ...


def read_lattice(path: str | Path, mesh: Mesh | None = None) -> Lattice | LatticeFile:
    """Read a lattice file; the mesh settles its automatic box and its locked borders.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh, optional
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
    # Polygons that cross themselves are refused, with all other faults, when faces are made.
    corners, polygon, _ = triangulate(mesh.vertices, mesh.corners, mesh.starts)
    if not len(corners):
        require_usable(mesh, inspect(mesh))
    points = mesh.vertices[corners]
    groups = {name: points[np.isin(polygon, members)] for name, members in mesh.groups.items()}
    return lattice.settle(
        bounds=mesh.bounds,
        triangles=points,
        delta=mesh.delta,
        groups=groups,
        smallest_box=smallest_box,
    )


def deform(
    mesh: Mesh,
    lattice: Lattice,
    *,
    patches: Patches = "merged",
    tolerance: float | None = None,
    max_degree: int | None = None,
    fit_tolerance: float | None = None,
    check: bool = True,
    require_solid: bool = False,
    require_injective: bool = False,
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
    tolerance : float, optional, model length
        Write fewer control points, certified to stay within this of the exact result; without it
        the result is exact.
    max_degree : int, optional
        With a tolerance: no degree is higher, where need be with more knots; at least 3.
    fit_tolerance : float, optional, model length
        For lattices that are no polynomials, ``embedding: inverse``: surfaces are fitted within
        this; 1e-5 of the mesh's size by default.
    check : bool
        Check topology, volume, and curves against surfaces before the result is handed out.
    require_solid : bool
        Refuse an open mesh, which gives an open shell otherwise.
    require_injective : bool
        Refuse a lattice that folds the model over, or of which the contrary cannot be proved.
    progress : callable, optional
        Told the name of each stage as it begins.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    if require_solid:
        require_closed(mesh, inspect(mesh))
    require_reducible(tolerance, max_degree)
    plan = prepare(mesh, lattice, patches=patches, fit_tolerance=fit_tolerance, progress=progress)
    return plan.deform(
        lattice,
        tolerance=tolerance,
        max_degree=max_degree,
        check=check,
        require_injective=require_injective,
        progress=progress,
    )


def deform_mesh(
    mesh: Mesh,
    lattice: Lattice,
    *,
    mode: Subdivision | Literal["exact"] = "exact",
    tolerance: float | None = None,
    levels: int | None = None,
    keep: Collection[Kept] = KEPT,
    fit_tolerance: float | None = None,
    check: bool = True,
    require_solid: bool = False,
    require_injective: bool = False,
    progress: Progress | None = None,
) -> MeshResult:
    """Bend a mesh with a lattice into triangles.

    Parameters
    ----------
    mesh, lattice, check, require_solid, require_injective, progress
        As for :func:`deform`.
    fit_tolerance
        Likewise, for `exact`; the other modes deform by the lattice itself.
    mode : {"exact", "vertices", "uniform", "adaptive"}
        Triangles of the exact surfaces; the mesh's own with their vertices deformed; halved
        throughout, until within the tolerance; halved where they are not within it.
    tolerance : float, optional, model length
        Largest distance from the exact surface, as it is looked for; 2e-4 of the mesh's
        size by default. Not for `vertices`.
    levels : int, optional
        For `uniform`: halve so many times, whatever comes of it.
    keep : collection of {"names", "texture"}
        What is wanted of the names of groups and bodies and of texture coordinates: no triangle
        then reaches from one to another. Materials are always told apart.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    if mode == "exact":
        if require_solid:
            require_closed(mesh, inspect(mesh))
        plan = prepare(mesh, lattice, keep=keep, fit_tolerance=fit_tolerance, progress=progress)
        result = plan.deform(
            lattice, check=check, require_injective=require_injective, progress=progress
        )
        return result.tessellate(tolerance, progress=progress)
    if fit_tolerance is not None:
        raise LatticeError(f"nothing is fitted for {mode} triangles", file=lattice.source.name)
    stage = Stopwatch(progress)
    with stage("check mesh"):
        soundness = inspect(mesh)
        require_usable(mesh, soundness)
        if require_solid:
            require_closed(mesh, soundness)
        corner, polygon = corner_triangles(mesh)
        corners = mesh.corners[corner]
    with stage("jacobian"):
        verdict = judge(lattice, place_in_each(mesh, soundness.nesting, lattice.volumes))
        if require_injective:
            require_injective_lattice(verdict, mesh, lattice)
    deformation = Deformation.of(lattice, mesh.delta)
    if mode == "vertices" or levels is not None:
        tolerance = None
    elif tolerance is None:
        tolerance = DEFAULT_TOLERANCE * mesh.size
    with stage("triangles"):
        piece, of_piece, places = polygon, np.arange(mesh.polygon_count), None
        if "texture" in keep and mesh.uv is not None:
            piece = find_charts(mesh.vertices, corners, mesh.uv[corner], polygon)
            of_piece = polygon[np.unique(piece, return_index=True)[1]]
            every = np.repeat(piece, 3)
            places = texture_of(every, corners.ravel(), mesh.uv[corner].reshape(-1, 2))
        done = subdivide(mesh.vertices, corners, piece, deformation, mode, tolerance, levels)
        owner = of_piece[done.net.owner]
        body = soundness.nesting.body[polygon]
        mirrored = mirrored_bodies(mesh.vertices[corners], body, deformation)
        turned = mirrored[soundness.nesting.body[owner]][:, None]
        facing = np.where(turned, done.net.triangles[:, ::-1], done.net.triangles)
        if check:
            require_whole(done.points, facing, soundness)
    return MeshResult(
        mesh=mesh,
        soundness=soundness,
        mode=mode,
        rest=done.net.rest,
        points=done.points,
        triangles=facing,
        owner=owner,
        polygon=owner,
        deviation=done.deviation,
        tolerance=tolerance,
        unit=unit_of(mesh, lattice),
        seconds=stage.seconds,
        warnings=tuple(warnings_of(mesh, soundness, lattice, verdict)),
        facts={"jacobian": verdict.report},
        uv=None if places is None else carry(places, done.net, facing),
    )
