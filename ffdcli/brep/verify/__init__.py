"""Judging a boundary representation: by itself, and against the deformation it should hold."""

from ffdcli.brep.verify.compare import Verification, from_faces, verify
from ffdcli.brep.verify.image import AGREE, Breaks, Image
from ffdcli.brep.verify.integrate import volume_of_brep
from ffdcli.brep.verify.own import BrepReport, check_brep
from ffdcli.brep.verify.topology import mesh_bodies

__all__ = [
    "AGREE",
    "Breaks",
    "BrepReport",
    "Image",
    "Verification",
    "check_brep",
    "from_faces",
    "mesh_bodies",
    "verify",
    "volume_of_brep",
]
