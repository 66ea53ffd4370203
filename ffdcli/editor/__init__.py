"""Lattices edited by hand: sessions, previews, histories; no page and no server.

The names below load on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.editor.mirror import Plane
    from ffdcli.editor.session import Session

_HOME = {"Plane": "mirror", "Session": "session"}

__all__ = ["Plane", "Session"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
