"""Lattices: files read and checked, settled by a mesh, edited, dragged, and written.

The names below load on first use, because pydantic and PyYAML load slowly.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.lattice.box_lattice import BoxLattice
    from ffdcli.lattice.export.save import save_lattice, solved_text
    from ffdcli.lattice.export.starter import OctreeStart, starter_text
    from ffdcli.lattice.export.steps import DragStep, drag_steps, save_steps, steps_text
    from ffdcli.lattice.file.load import parse_spec
    from ffdcli.lattice.file.spec import LatticeSpec, json_schema
    from ffdcli.lattice.lattice import Lattice
    from ffdcli.lattice.lattice_file import LatticeFile, load_lattice, parse_lattice

_HOME = {
    "box_lattice": ("BoxLattice",),
    "lattice": ("Lattice",),
    "lattice_file": ("LatticeFile", "load_lattice", "parse_lattice"),
    "file.load": ("parse_spec",),
    "file.spec": ("LatticeSpec", "json_schema"),
    "export.save": ("save_lattice", "solved_text"),
    "export.starter": ("OctreeStart", "starter_text"),
    "export.steps": ("DragStep", "drag_steps", "save_steps", "steps_text"),
}

__all__ = [
    "BoxLattice",
    "DragStep",
    "Lattice",
    "LatticeFile",
    "LatticeSpec",
    "OctreeStart",
    "drag_steps",
    "json_schema",
    "load_lattice",
    "parse_lattice",
    "parse_spec",
    "save_lattice",
    "save_steps",
    "solved_text",
    "starter_text",
    "steps_text",
]


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
