"""Names and materials of the parts of a scene, as glTF and 3MF files have them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.labels import Labels, number_names
from ffdcli.mesh.io.materials import SceneMaterials, gltf_materials, threemf_materials


def stated_name(scene: Any, node: str) -> str:
    """The name that the file gives a node; parts of a glTF mesh have that of the node above."""
    _, name = scene.graph[node]
    if scene.geometry[name].metadata.get("from_gltf_primitive"):
        node = str(scene.graph.transforms.parents.get(node, node))
    # The reader numbers the nodes that have no name.
    return "" if node.isdigit() else node


def _materials(path: Path, data: bytes) -> SceneMaterials | None:
    """Materials of the formats that have names and colours; None for others."""
    extension = path.suffix.lower().lstrip(".")
    try:
        if extension in ("glb", "gltf"):
            return gltf_materials(data)
        return threemf_materials(path) if extension == "3mf" else None
    except (KeyError, TypeError, ValueError, AttributeError, StopIteration):
        # What the general reader made sense of holds without colours too.
        return SceneMaterials((), ())


def scene_labels(
    nodes: list[tuple[str, str, int]], geometries: list[str], path: Path, data: bytes
) -> Labels | None:
    """Bodies and materials of a scene's polygons; None where the format or the file has none.

    Parameters
    ----------
    nodes : list of (name, geometry, number of polygons)
        In the order of the polygons.
    geometries : list of str
        All of the scene, in the reader's order.
    path, data
        The file and what is in it.
    """
    found = _materials(path, data)
    if found is None:
        return None
    parts = dict(zip(geometries, found.parts, strict=False))
    if len(found.parts) != len(geometries):
        parts = {}
    names, materials = [], []
    for node, geometry, count in nodes:
        part = parts.get(geometry)
        names += [node or (part.name if part else "")] * count
        fits = part is not None and len(part.material) in (1, count)
        own = part.material if part is not None and fits else np.array([-1])
        materials.append(np.broadcast_to(own, count))
    bodies, body = number_names(names)
    if not bodies and not found.materials:
        return None
    none = np.full(len(names), -1, dtype=np.int64)
    return Labels(bodies, (), found.materials, body, none, np.concatenate(materials))
