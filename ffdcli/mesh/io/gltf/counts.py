"""What a glTF file promises, counted from its JSON alone, to be compared with what was read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ffdcli.mesh.io.gltf.container import INSTANCING
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.mesh.io.gltf.triangles import is_surface, promised_triangles


@dataclass(frozen=True)
class Counts:
    """Meshes that are placed, copies included, and their triangles."""

    placed: int
    triangles: int


def require_counts(root: Entry, shown: Sequence[int], read: Sequence[Counts]) -> None:
    """Raise Unreadable if less or more was read than the counts of the file promise.

    Parameters
    ----------
    shown : sequence of int
        Nodes of the scene.
    read : sequence of Counts
        What was read for each node with a mesh.
    """
    promised = _promised(root, shown)
    placed, triangles = (
        sum(getattr(each, key) for each in read) for key in ("placed", "triangles")
    )
    if (placed, triangles) != (promised.placed, promised.triangles):
        raise Unreadable(
            f"it promises {promised.triangles} triangles of {promised.placed} placed meshes, "
            f"but holds {triangles} of {placed}"
        )


def _promised(root: Entry, shown: Sequence[int]) -> Counts:
    """What the nodes of the scene place, by the counts of accessors, modes and copies."""
    nodes, accessors = root.entries("nodes"), root.entries("accessors")
    meshes = [_triangles(mesh, accessors) for mesh in root.entries("meshes")]
    placed = triangles = 0
    for number in shown:
        mesh = nodes[number].index("mesh", len(meshes))
        if mesh is None or meshes[mesh] == 0:
            continue
        copies = _copies(nodes[number], accessors)
        placed += copies
        triangles += copies * meshes[mesh]
    return Counts(placed, triangles)


def _triangles(mesh: Entry, accessors: list[Entry]) -> int:
    total = 0
    for primitive in filter(is_surface, mesh.entries("primitives")):
        number = primitive.index("indices", len(accessors))
        if number is None:
            number = primitive.entry("attributes").index("POSITION", len(accessors)) or 0
        mode = primitive.whole("mode", 4)
        total += promised_triangles(mode, accessors[number].whole("count"))
    return total


def _copies(node: Entry, accessors: list[Entry]) -> int:
    stated = node.extension(INSTANCING)
    if stated is None:
        return 1
    attributes = stated.entry("attributes")
    found = (attributes.index(name, len(accessors)) for name in sorted(attributes.values))
    return max((accessors[n].whole("count") for n in found if n is not None), default=0)
