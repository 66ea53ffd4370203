"""Checks of a boundary representation: by itself, and against a deformed mesh."""

from ffdcli.brep.evaluate.closedness import mesh_bodies
from ffdcli.brep.evaluate.integrate import volume_of_brep
from ffdcli.verify.compare import Verification, from_faces, verify
from ffdcli.verify.flux import AGREE
from ffdcli.verify.image import Image
from ffdcli.verify.own_check import BrepReport, check_brep

__all__ = [
    "AGREE",
    "BrepReport",
    "Image",
    "Verification",
    "check_brep",
    "from_faces",
    "mesh_bodies",
    "verify",
    "volume_of_brep",
]
