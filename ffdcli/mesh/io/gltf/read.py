"""Read glTF 2.0: all meshes that the scene places, named, with materials and textures' places."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.mesh.io.gltf.accessors import Arrays
from ffdcli.mesh.io.gltf.container import INSTANCING, open_container
from ffdcli.mesh.io.gltf.counts import Counts, require_counts
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.mesh.io.gltf.left_out import describe_left_out
from ffdcli.mesh.io.gltf.materials import read_materials
from ffdcli.mesh.io.gltf.meshes import Meshes
from ffdcli.mesh.io.gltf.nodes import Nodes, place_copies, read_nodes
from ffdcli.mesh.io.gltf.skins import apply_skin, joint_matrices
from ffdcli.mesh.io.gltf.units import read_unit
from ffdcli.mesh.io.placed_parts import PlacedPart, join_parts
from ffdcli.mesh.io.raw_mesh import RawMesh
from ffdcli.messages import counted


def decode_gltf(data: bytes, path: Path) -> RawMesh:
    """All meshes that the scene of a file places.

    Raises
    ------
    FileError
        The file is damaged, or needs what is not known here.
    """
    try:
        return _decode(data, path)
    except Unreadable as error:
        raise FileError(
            f"the file cannot be read as {path.suffix.lower()}: {error}",
            file=str(path),
            hint=error.hint,
        ) from error


@dataclass(frozen=True)
class _File:
    """The parts of a file that place its meshes."""

    arrays: Arrays
    meshes: Meshes
    nodes: Nodes
    skins: list[Entry]
    joints: dict[int, Floats] = field(default_factory=dict)

    def joint_matrices(self, number: int) -> Floats:
        """Matrices of the joints of a skin, made once."""
        if number not in self.joints:
            self.joints[number] = joint_matrices(self.skins[number], self.nodes, self.arrays)
        return self.joints[number]


@dataclass(frozen=True)
class _Placed:
    """The parts that one node places; copies and triangles of all, with those left out of strips.

    Parameters
    ----------
    uneven : int
        Vertices whose weights do not add up to 1.
    """

    parts: list[PlacedPart]
    counts: Counts
    uneven: int


def _decode(data: bytes, path: Path) -> RawMesh:
    root, binary = open_container(data)
    arrays = Arrays(root, binary, path)
    materials, looks = read_materials(root)
    meshes, nodes = Meshes(root, arrays, looks), read_nodes(root)
    count = len(meshes.entries)
    used = {
        n: mesh for n in nodes.shown if (mesh := nodes.entries[n].index("mesh", count)) is not None
    }
    if not used:
        raise Unreadable("no node of its scene has a mesh", "put the meshes into the scene")
    pairs = [(meshes.entries[mesh], nodes.entries[n]) for n, mesh in used.items()]
    unit, notes = read_unit(root, nodes.scene, pairs)
    file = _File(arrays, meshes, nodes, root.entries("skins"))
    placed = [_place(file, number, mesh) for number, mesh in used.items()]
    require_counts(root, nodes.shown, [each.counts for each in placed])
    notes += describe_left_out(root, nodes.shown)
    uneven = sum(each.uneven for each in placed)
    if uneven:
        notes += (
            f"{counted(uneven, 'vertex is', 'vertices are')} moved by shares of joints that do not "
            "add up to 1: they are divided by their sum",
        )
    parts = [part for each in placed for part in each.parts]
    return join_parts(parts, path, materials=materials, unit=unit, notes=notes)


def _place(file: _File, number: int, mesh: int) -> _Placed:
    """The parts that a node places."""
    node = file.nodes.entries[number]
    skin = node.index("skin", len(file.skins))
    name = node.text("name") or file.meshes.entries[mesh].text("name")
    pieces = file.meshes.read(mesh, node.numbers("weights"), skin is not None)
    transforms = place_copies(node, file.nodes.world[number], file.arrays)
    parts, uneven = [], 0
    for piece in pieces:
        vertices, triangles, resolution = piece.vertices, piece.triangles, piece.resolution
        if skin is not None:
            if node.extension(INSTANCING) is not None:
                raise Unreadable(f"{node.place} has both a skin and {INSTANCING}")
            # Joints place the mesh; the place of its node does not count.
            moved = apply_skin(file.skins[skin], piece, file.joint_matrices(skin), file.arrays)
            vertices, resolution, transforms = moved.vertices, moved.resolution, np.eye(4)[None]
            triangles = triangles[:, ::-1] if moved.mirrored else triangles
            uneven += moved.uneven
        parts.append(
            PlacedPart(
                number, name, vertices, triangles, resolution, transforms, piece.material, piece.uv
            )
        )
    total = sum(len(piece.triangles) + piece.stitches for piece in pieces)
    copies = len(transforms) if total else 0
    return _Placed(parts, Counts(copies, copies * total), uneven)
