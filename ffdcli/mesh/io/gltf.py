"""What the general reader leaves out of glTF files: their tree, and texture coordinates.

It reads texture coordinates only together with images, which nobody wants here.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats

# Primitives that the general reader makes a part of: points, lines, triangles and strips.
_PARTS = (0, 1, 4, 5)
_HEADER, _CHUNK = 12, 8
# Numbers of texture coordinates; whole ones stand for 0 to 1.
_NUMBERS = {5126: ("<f4", 1), 5121: ("u1", 255), 5123: ("<u2", 65535)}


def gltf_tree(data: bytes) -> dict[str, Any]:
    """The JSON of a .glb or .gltf file."""
    return dict(json.loads(_chunks(data)[0]))


def gltf_parts(tree: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Mesh and primitive of each part that the general reader makes, in its order."""
    return [
        (mesh, part)
        for mesh in tree.get("meshes", [])
        for part in mesh["primitives"]
        if part.get("mode", 4) in _PARTS
    ]


def gltf_uv(data: bytes, folder: Path) -> list[Floats | None]:
    """Texture coordinates (n, 2) of the vertices of each part, v upwards; None where it has none.

    Parameters
    ----------
    data : bytes
        Of a .glb or .gltf file that has been read already.
    folder : Path
        Where the files are that it names.
    """
    tree = gltf_tree(data)
    stored: dict[int, bytes] = {}
    out: list[Floats | None] = []
    for _, part in gltf_parts(tree):
        number = part.get("attributes", {}).get("TEXCOORD_0")
        accessor = {} if number is None else tree["accessors"][number]
        if "bufferView" not in accessor or "sparse" in accessor:
            out.append(None)
            continue
        view = tree["bufferViews"][accessor["bufferView"]]
        place = view["buffer"]
        if place not in stored:
            stored[place] = _buffer(tree["buffers"][place], data, folder)
        kind, whole = _NUMBERS[accessor["componentType"]]
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
    return out


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary part; the latter is empty in .gltf files."""
    if data[:4] != b"glTF":
        return data, b""
    begin = _HEADER + _CHUNK
    end = begin + int.from_bytes(data[_HEADER : _HEADER + 4], "little")
    return data[begin:end], data[end + _CHUNK :]


def _buffer(entry: dict[str, Any], data: bytes, folder: Path) -> bytes:
    uri = entry.get("uri")
    if uri is None:
        return _chunks(data)[1]
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (folder / str(uri)).read_bytes()
