"""Judging a boundary representation: by itself, and against the deformation it should hold."""

from ffdcli.brep.verify.compare import Verification, verify
from ffdcli.brep.verify.image import Breaks
from ffdcli.brep.verify.integrate import volume_of_brep
from ffdcli.brep.verify.own import BrepReport, check_brep

__all__ = ["Breaks", "BrepReport", "Verification", "check_brep", "verify", "volume_of_brep"]
