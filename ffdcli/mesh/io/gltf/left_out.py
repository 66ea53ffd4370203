"""What is left out of a glTF file, said in notes."""

from __future__ import annotations

from collections.abc import Sequence

from ffdcli.mesh.io.gltf.entries import Entry
from ffdcli.mesh.io.gltf.materials import read_materials
from ffdcli.mesh.io.gltf.triangles import is_surface
from ffdcli.messages import counted


def describe_left_out(root: Entry, shown: Sequence[int]) -> tuple[str, ...]:
    """A sentence for each kind of thing that is not read, or not as it is shown.

    Parameters
    ----------
    shown : sequence of int
        Nodes of the scene that is read.
    """
    nodes, meshes, scenes = (root.entries(key) for key in ("nodes", "meshes", "scenes"))
    used = {nodes[number].index("mesh", len(meshes)) for number in shown}
    notes = []
    if len(scenes) > 1:
        notes.append(f"the file has {len(scenes)} scenes: only its default or first one is read")
    unused = [mesh for number, mesh in enumerate(meshes) if number not in used]
    if unused:
        what = counted(len(unused), "mesh is", "meshes are")
        name = unused[0].text("name") or unused[0].place
        notes.append(f"{what} in no node of the scene: left out, the first is {name!r}")
    primitives = [
        primitive
        for number in sorted(number for number in used if number is not None)
        for primitive in meshes[number].entries("primitives")
    ]
    bare = sum(not is_surface(primitive) for primitive in primitives)
    if bare:
        what = counted(bare, "primitive of points or lines is", "primitives of points or lines are")
        notes.append(f"{what} left out")
    hidden = sum(_is_hidden(nodes[number]) for number in shown)
    if hidden:
        notes.append(f"{counted(hidden, 'node is', 'nodes are')} hidden, but read")
    if root.entries("animations"):
        notes.append("animations are left out: the rest pose is read")
    turned = [look for look in read_materials(root)[1] if look.turned]
    if turned:
        what = counted(len(turned), "material turns its", "materials turn their")
        notes.append(f"{what} image: texture coordinates there are left out")
    return tuple(notes)


def _is_hidden(node: Entry) -> bool:
    stated = node.extension("KHR_node_visibility")
    return stated is not None and stated.values.get("visible") is False
