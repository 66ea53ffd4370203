"""Polygon meshes: the record, mesh files, triangles and bodies, checks and repair."""

from ffdcli.mesh.io.read import read_mesh
from ffdcli.mesh.oriented_box import smallest_box
from ffdcli.mesh.polygons import triangles, triangulate
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, shells
from ffdcli.mesh.soundness.checked_mesh import CheckedMesh, check_mesh
from ffdcli.mesh.soundness.fault_messages import (
    describe_faults,
    describe_remarks,
    require_closed,
    require_usable,
    usability,
)
from ffdcli.mesh.soundness.inspection import Finding, Soundness, describe, inspect
from ffdcli.mesh.soundness.repair import repair

__all__ = [
    "CheckedMesh",
    "Finding",
    "Mesh",
    "ShellNesting",
    "Soundness",
    "check_mesh",
    "describe",
    "describe_faults",
    "describe_remarks",
    "inspect",
    "read_mesh",
    "repair",
    "require_closed",
    "require_usable",
    "shells",
    "smallest_box",
    "triangles",
    "triangulate",
    "usability",
]
