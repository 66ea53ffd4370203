"""A mesh that has been checked, with the triangles of its polygons."""

from __future__ import annotations

from dataclasses import dataclass

from ffdcli.arrays import Ints
from ffdcli.mesh.polygons import corner_triangles
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.fault_messages import require_closed, require_usable
from ffdcli.mesh.soundness.inspection import Soundness, inspect


@dataclass(frozen=True)
class CheckedMesh:
    """A mesh that faces can be made of.

    Parameters
    ----------
    corner : (T, 3) int64
        Polygon corners of the triangles: positions in ``mesh.corners``.
    polygon : (T,) int64
        Polygon of each triangle.
    """

    mesh: Mesh
    soundness: Soundness
    corner: Ints
    polygon: Ints

    @property
    def triangles(self) -> Ints:
        """(T, 3) vertices of the triangles."""
        return self.mesh.corners[self.corner]


def check_mesh(mesh: Mesh, *, require_solid: bool = False) -> CheckedMesh:
    """Check a mesh and triangulate its polygons.

    Raises
    ------
    MeshError
        The mesh has faults that prevent faces, or is open although a solid is required.
    """
    soundness = inspect(mesh)
    if require_solid:
        require_closed(mesh, soundness)
    require_usable(mesh, soundness)
    corner, polygon = corner_triangles(mesh)
    return CheckedMesh(mesh, soundness, corner, polygon)
