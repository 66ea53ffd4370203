"""Bend a polygon mesh with a free-form deformation lattice and write the exact result as CAD.

    from ffdcli import read_mesh, read_lattice, prepare, deform

    mesh = read_mesh("mesh.obj")
    lattice = read_lattice("lattice.yaml", mesh)
    deform(mesh, lattice).write("out.step")

Names are imported on first use, so that ``import ffdcli`` is fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.read import read_part
    from ffdcli.errors import FfdError
    from ffdcli.field_fit import fit_field
    from ffdcli.fields.read import read_field
    from ffdcli.folds.verdict import injective_scale
    from ffdcli.lattice.export.fit_text import FitChoice
    from ffdcli.mesh import Mesh, read_mesh
    from ffdcli.part.record import Part
    from ffdcli.pipeline import Coplanar, Plan, deform, prepare, read_lattice
    from ffdcli.result import Result
    from ffdcli.tessellate.mesh_result import MeshResult
    from ffdcli.triangles import deform_mesh

__version__ = "0.1.0"

_HOME = {
    "Part": "part.record",
    "Coplanar": "pipeline",
    "FfdError": "errors",
    "FitChoice": "lattice.export.fit_text",
    "Mesh": "mesh",
    "MeshResult": "tessellate.mesh_result",
    "Plan": "pipeline",
    "Result": "result",
    "deform": "pipeline",
    "deform_mesh": "triangles",
    "fit_field": "field_fit",
    "injective_scale": "folds.verdict",
    "prepare": "pipeline",
    "read_field": "fields.read",
    "read_lattice": "pipeline",
    "read_mesh": "mesh",
    "read_part": "brep.occ.part.read",
}

__all__ = [
    "Coplanar",
    "FfdError",
    "FitChoice",
    "Mesh",
    "MeshResult",
    "Part",
    "Plan",
    "Result",
    "deform",
    "deform_mesh",
    "fit_field",
    "injective_scale",
    "prepare",
    "read_field",
    "read_lattice",
    "read_mesh",
    "read_part",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
