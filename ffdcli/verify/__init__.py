"""Checks of a written file against the deformation."""

from ffdcli.brep.evaluate.closedness import mesh_bodies
from ffdcli.brep.evaluate.integrate import volume_of_brep
from ffdcli.brep.evaluate.own_check import BrepReport, check_brep
from ffdcli.brep.evaluate.quadrature import AGREE
from ffdcli.verify.compare import Verification, from_faces, verify
from ffdcli.verify.deformed_mesh import DeformedMesh

__all__ = [
    "AGREE",
    "BrepReport",
    "DeformedMesh",
    "Verification",
    "check_brep",
    "from_faces",
    "mesh_bodies",
    "verify",
    "volume_of_brep",
]
