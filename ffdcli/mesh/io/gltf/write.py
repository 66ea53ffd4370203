"""Write binary glTF, by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh, split_at_seams, split_parts


def encode_glb(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A binary file with one node for each combination of groups and material."""
    import trimesh

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    parts, uv = split_parts(mesh), mesh.uv
    titles = parts.titles(mesh.name)
    for title, material, chosen in zip(titles, parts.material, parts.triangles, strict=True):
        places = None
        if uv is None or np.isnan(uv[chosen]).all():
            used, corners = np.unique(mesh.triangles[chosen], return_inverse=True)
        else:
            used, corners, places = split_at_seams(mesh.triangles[chosen], uv[chosen])
        body: Any = trimesh.Trimesh(mesh.vertices[used], corners.reshape(-1, 3), process=False)
        look: Any = None
        if material >= 0:
            known = mesh.paint.materials[material]
            colour = None if known.colour is None else [*map(_linear, known.colour), 1.0]
            look = visual.material.PBRMaterial(name=known.name, baseColorFactor=colour)
        elif places is not None:
            # trimesh writes texture coordinates only with a material.
            look = visual.material.PBRMaterial()
        if look is not None:
            body.visual = visual.TextureVisuals(uv=places, material=look)
        scene.add_geometry(body, node_name=title, geom_name=title)
    return EncodedMesh(bytes(scene.export(file_type="glb")))


# Colours of glTF are linear; those of `Material` are sRGB (IEC 61966-2-1).
def _linear(encoded: float) -> float:
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4
