"""Lattices: files read and checked, settled by a mesh, edited, dragged, and written.

The names below load on first use, because pydantic and ruamel.yaml load slowly.
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
    "BoxLattice": "box_lattice",
    "Lattice": "lattice",
    "LatticeFile": "lattice_file",
    "load_lattice": "lattice_file",
    "parse_lattice": "lattice_file",
    "parse_spec": "file.load",
    "save_lattice": "export.save",
    "solved_text": "export.save",
    "LatticeSpec": "file.spec",
    "json_schema": "file.spec",
    "OctreeStart": "export.starter",
    "starter_text": "export.starter",
    "DragStep": "export.steps",
    "drag_steps": "export.steps",
    "save_steps": "export.steps",
    "steps_text": "export.steps",
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
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
