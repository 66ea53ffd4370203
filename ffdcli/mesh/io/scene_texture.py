"""Texture coordinates of the parts of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.gltf import gltf_uv


def stored_uv(geometries: list[str], path: Path, data: bytes) -> dict[str, Floats | None]:
    """Texture coordinates of the vertices of each part of a glTF file, by the part's name."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        return {}
    try:
        found = gltf_uv(data, path.parent)
    except (KeyError, IndexError, TypeError, ValueError, OSError):
        # What the general reader made sense of holds without them too.
        return {}
    return dict(zip(geometries, found, strict=True)) if len(found) == len(geometries) else {}


def part_uv(geometry: Any, faces: Ints, stored: Floats | None) -> Floats | None:
    """(3 T, 2) texture coordinates of a part's corners, as stored or as the reader has them."""
    uv = getattr(geometry.visual, "uv", None) if stored is None else stored
    if uv is None or np.shape(uv)[:1] != (len(geometry.vertices),) or np.shape(uv)[1] < 2:
        return None
    return np.asarray(uv, dtype=np.float64)[faces.ravel(), :2]


def join_uv(parts: list[Floats | None], counts: list[int]) -> Floats | None:
    """Texture coordinates of all parts' corners, NaN for parts without; None where none has any.

    Parameters
    ----------
    parts : list of (C, 2) float64 or None
    counts : list of int
        Corners of each part.
    """
    if all(part is None for part in parts):
        return None
    none = np.array([[np.nan, np.nan]])
    pairs = zip(parts, counts, strict=True)
    return np.concatenate([np.repeat(none, n, axis=0) if p is None else p for p, n in pairs])
