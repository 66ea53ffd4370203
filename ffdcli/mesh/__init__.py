"""The mesh record: reading it, checking it, and telling its bodies apart."""

from ffdcli.mesh.bounds import smallest_box
from ffdcli.mesh.check import Finding, Soundness, inspect, require_closed, require_usable
from ffdcli.mesh.polygons import triangles
from ffdcli.mesh.read import read_mesh
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, shells

__all__ = [
    "Finding",
    "Mesh",
    "ShellNesting",
    "Soundness",
    "inspect",
    "read_mesh",
    "require_closed",
    "require_usable",
    "shells",
    "smallest_box",
    "triangles",
]
