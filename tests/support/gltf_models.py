"""Small glTF files, put together array by array."""

import json
import struct

import numpy as np

from ffdcli.mesh import inspect
from support.mesh_models import CORNERS, QUADS

COMPONENTS = {"f4": 5126, "u4": 5125, "u2": 5123, "i2": 5122, "u1": 5121, "i1": 5120}
SIZE = np.array([10.0, 20.0, 30.0])
# A box of volume 6000, its twelve triangles, and its six quads as rings.
BOX = CORNERS * SIZE
RINGS = np.array(QUADS)
TRIANGLES = np.concatenate([RINGS[:, [0, 1, 2]], RINGS[:, [0, 2, 3]]])
VOLUME = 6000.0


class GltfModel:
    """JSON and bytes of a file; methods add one thing and return its number."""

    def __init__(self):
        self.data = b""
        self.tree = {"asset": {"version": "2.0"}, "buffers": [{}], "scenes": [{"nodes": []}]}

    def add(self, key, entry):
        self.tree.setdefault(key, []).append(entry)
        return len(self.tree[key]) - 1

    def place(self, content):
        """Bytes, and where they are: no entry by itself."""
        self.data += b"\0" * (-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        self.data += content
        return place

    def view(self, content, **more):
        return self.add("bufferViews", self.place(content) | more)

    def accessor(self, array, kind, **more):
        array = np.ascontiguousarray(array)
        view = self.view(array.tobytes())
        component = COMPONENTS[array.dtype.str[1:]]
        entry = {"bufferView": view, "componentType": component, "count": len(array), "type": kind}
        return self.add("accessors", entry | more)

    def points(self, points):
        return self.accessor(np.asarray(points, "<f4"), "VEC3")

    def indices(self, numbers, kind="<u2"):
        return self.accessor(np.ravel(numbers).astype(kind), "SCALAR")

    def box(self, move=(0, 0, 0), points=BOX):
        """A primitive."""
        position = self.points(np.asarray(points) + move)
        return {"attributes": {"POSITION": position}, "indices": self.indices(TRIANGLES)}

    def mesh(self, *primitives, **more):
        return self.add("meshes", {"primitives": list(primitives)} | more)

    def node(self, *, root=True, **entry):
        number = self.add("nodes", entry)
        if root:
            self.tree["scenes"][0]["nodes"].append(number)
        return number

    def require(self, *names):
        self.tree["extensionsUsed"] = self.tree["extensionsRequired"] = list(names)

    def glb(self):
        """The bytes of a .glb file."""
        self.tree["buffers"][0].setdefault("byteLength", len(self.data))
        return pack_glb(json.dumps(self.tree).encode(), self.data)

    def gltf(self, uri):
        """The text of a .gltf file whose data are elsewhere."""
        self.tree["buffers"][0].update(uri=uri, byteLength=len(self.data))
        return json.dumps(self.tree)


def pack_glb(text, data, version=2):
    """Binary glTF of a JSON part and a binary part."""
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return b"glTF" + struct.pack("<II", version, 12 + len(chunks)) + chunks


def plain_model():
    """One box."""
    model = GltfModel()
    model.node(mesh=model.mesh(model.box()), name="Box")
    return model


def volumes(mesh):
    soundness = inspect(mesh)
    assert soundness.closed
    return sorted(soundness.volumes)
