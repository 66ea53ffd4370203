"""glTF files (.gltf, .glb), decoded and encoded.

trimesh reads the geometry. Materials, and texture coordinates, which it reads only together with
images, are taken from the JSON tree; they are matched with its geometries by their order.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.labels import Material
from ffdcli.mesh.io.painted_mesh import EncodedMesh, PaintedMesh, split_at_seams, split_parts
from ffdcli.mesh.io.raw_mesh import RawMesh
from ffdcli.mesh.io.scenes import SceneMaterials, join_scene, load_scene
from ffdcli.mesh.io.text_numbers import parse_colour

# Modes of the primitives that trimesh makes a geometry of: points, lines, triangles, strips.
_MODES = (0, 1, 4, 5)
_HEADER, _CHUNK = 12, 8
# Types of texture coordinates, and the integer that stands for 1.
_TYPES = {5126: ("<f4", 1), 5121: ("u1", 255), 5123: ("<u2", 65535)}


def decode_gltf(data: bytes, path: Path) -> RawMesh:
    """All meshes of a file, with names, materials and texture coordinates."""
    scene = load_scene(path)
    return join_scene(scene, _materials(data), _texture(data, path.parent))


def _materials(data: bytes) -> SceneMaterials:
    """Materials, none if unreadable: what trimesh reads is a mesh without them too."""
    try:
        tree = json.loads(_chunks(data)[0])
        return SceneMaterials(
            tuple(_material(number, each) for number, each in enumerate(tree.get("materials", []))),
            tuple(
                (str(mesh.get("name", "")), np.array([part.get("material", -1)], dtype=np.int64))
                for mesh, part in _primitives(tree)
            ),
        )
    except (KeyError, TypeError, ValueError, AttributeError):
        return SceneMaterials()


def _material(number: int, entry: dict[str, Any]) -> Material:
    # Without a factor the colour comes from a texture.
    factor = entry.get("pbrMetallicRoughness", {}).get("baseColorFactor")
    colour = None if factor is None else parse_colour(factor[:3])
    if colour is not None:
        colour = (_encoded(colour[0]), _encoded(colour[1]), _encoded(colour[2]))
    return Material(str(entry.get("name", f"material {number + 1}")), colour)


def _primitives(tree: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Mesh and primitive of each geometry that trimesh makes, in its order."""
    return [
        (mesh, part)
        for mesh in tree.get("meshes", [])
        for part in mesh["primitives"]
        if part.get("mode", 4) in _MODES
    ]


def _texture(data: bytes, folder: Path) -> list[Floats | None]:
    """(n, 2) texture coordinates of each primitive's vertices, v upwards; None for those without.

    The list is empty if they are unreadable.
    """
    stored: dict[int, bytes] = {}
    out: list[Floats | None] = []
    try:
        tree = json.loads(_chunks(data)[0])
        for _, part in _primitives(tree):
            number = part.get("attributes", {}).get("TEXCOORD_0")
            accessor = {} if number is None else tree["accessors"][number]
            if "bufferView" not in accessor or "sparse" in accessor:
                out.append(None)
                continue
            view = tree["bufferViews"][accessor["bufferView"]]
            place = view["buffer"]
            if place not in stored:
                stored[place] = _buffer(tree["buffers"][place], data, folder)
            kind, whole = _TYPES[accessor["componentType"]]
            width = 2 * np.dtype(kind).itemsize
            rows = np.ndarray(
                (accessor["count"], 2),
                kind,
                stored[place],
                view.get("byteOffset", 0) + accessor.get("byteOffset", 0),
                (view.get("byteStride", width), width // 2),
            )
            uv = rows.astype(np.float64) / whole
            # glTF counts v downwards.
            out.append(np.column_stack([uv[:, 0], 1 - uv[:, 1]]))
    except (KeyError, IndexError, TypeError, ValueError, OSError):
        return []
    return out


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """JSON and binary part; the latter is empty in .gltf files."""
    if data[:4] != b"glTF":
        return data, b""
    begin = _HEADER + _CHUNK
    end = begin + int.from_bytes(data[_HEADER : _HEADER + 4], "little")
    return data[begin:end], data[end + _CHUNK :]


def _buffer(entry: dict[str, Any], data: bytes, folder: Path) -> bytes:
    """Content of a buffer: in the file, in its URI, or in another file."""
    uri = entry.get("uri")
    if uri is None:
        return _chunks(data)[1]
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (folder / str(uri)).read_bytes()


def encode_glb(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A binary file with one node for each combination of groups and material."""
    import trimesh

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    parts, uv = split_parts(mesh), mesh.uv
    for number, title in enumerate(parts.titles(mesh.name)):
        chosen, places = parts.label == number, None
        if uv is None or np.isnan(uv[chosen]).all():
            used, corners = np.unique(mesh.triangles[chosen], return_inverse=True)
        else:
            used, corners, places = split_at_seams(mesh.triangles[chosen], uv[chosen])
        body: Any = trimesh.Trimesh(mesh.vertices[used], corners.reshape(-1, 3), process=False)
        look: Any = None
        if parts.material[number] >= 0:
            known = mesh.paint.materials[parts.material[number]]
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
def _encoded(linear: float) -> float:
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def _linear(encoded: float) -> float:
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4
