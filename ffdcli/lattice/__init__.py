"""Lattice files: their models, reading, edits and locked borders; the way from YAML to a volume.

The names below load on first use, since pydantic and ruamel.yaml take a moment.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.lattice.lattice import Lattice
    from ffdcli.lattice.load import parse_spec
    from ffdcli.lattice.save import save_lattice, solved_text
    from ffdcli.lattice.several import AnyLattice, Lattices, load_lattice
    from ffdcli.lattice.spec import LatticeSpec, json_schema
    from ffdcli.lattice.starter import OctreeStart, starter_text
    from ffdcli.lattice.steps import DragStep, drag_steps, save_steps, steps_text

_HOME = {
    "AnyLattice": "several",
    "Lattice": "lattice",
    "Lattices": "several",
    "load_lattice": "several",
    "parse_spec": "load",
    "save_lattice": "save",
    "solved_text": "save",
    "LatticeSpec": "spec",
    "json_schema": "spec",
    "OctreeStart": "starter",
    "starter_text": "starter",
    "DragStep": "steps",
    "drag_steps": "steps",
    "save_steps": "steps",
    "steps_text": "steps",
}

__all__ = [
    "AnyLattice",
    "DragStep",
    "Lattice",
    "LatticeSpec",
    "Lattices",
    "OctreeStart",
    "drag_steps",
    "json_schema",
    "load_lattice",
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
