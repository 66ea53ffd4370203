"""Meshes of a glTF file in their own coordinates; primitives on the same vertices are one piece."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.gltf.accessors import Arrays
from ffdcli.mesh.io.gltf.container import DRACO, requires
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.mesh.io.gltf.materials import Look
from ffdcli.mesh.io.gltf.triangles import LIST, is_surface, make_triangles
from ffdcli.mesh.io.gltf.vertices import Source, joints, open_source, positions, texture


@dataclass(frozen=True)
class Piece:
    """Primitives of a mesh on the same vertices.

    Parameters
    ----------
    vertices : (V, 3) float64
    triangles : (T, 3) int64
    material : (T,) int64
        -1 for none.
    resolution : float
        Smallest distance that the numbers of the vertices resolve.
    uv : (V, 2) float64 or None
        Texture coordinates, v upwards.
    joints, weights : (V, J) int64 and float64, or None
        Joints of the skin that move a vertex, and their shares.
    stitches : int
        Triangles that only join strips, and are left out.
    """

    vertices: Floats
    triangles: Ints
    material: Ints
    resolution: float
    uv: Floats | None
    joints: Ints | None
    weights: Floats | None
    stitches: int


@dataclass(frozen=True)
class _Group:
    """Primitives on the same vertices: accessors by their use, with targets, and the look."""

    uses: tuple[tuple[tuple[str, int], ...], ...]
    look: Look
    packed: str

    @property
    def position(self) -> int:
        """Accessor of the positions."""
        return dict(self.uses[0])["POSITION"]


class Meshes:
    """The meshes of a file, each read once for each set of morph weights."""

    def __init__(self, root: Entry, arrays: Arrays, looks: list[Look]) -> None:
        self.entries = root.entries("meshes")
        self._arrays, self._looks = arrays, looks
        self._all_packed = requires(root, DRACO)
        self._groups = [self._alike(mesh) for mesh in self.entries]
        self._users = Counter(group.position for groups in self._groups for group in groups)
        self._read: dict[tuple[int, bytes, bool], list[Piece]] = {}

    def read(self, number: int, weights: Floats | None, skinned: bool) -> list[Piece]:
        """The pieces of a mesh.

        Parameters
        ----------
        weights : (n,) float64 or None
            Shares of the morph targets; None for those that the mesh states.
        skinned : bool
            Whether joints and their weights are read.

        Raises
        ------
        Unreadable
            The mesh is damaged.
        """
        shares = self.entries[number].numbers("weights") if weights is None else weights
        shares = np.zeros(0) if shares is None else shares
        key = (number, shares.tobytes(), skinned)
        if key not in self._read:
            self._read[key] = [
                self._piece(group, primitives, shares, skinned)
                for group, primitives in self._groups[number].items()
            ]
        return self._read[key]

    def _alike(self, mesh: Entry) -> dict[_Group, list[Entry]]:
        groups: dict[_Group, list[Entry]] = {}
        for primitive in filter(is_surface, mesh.entries("primitives")):
            maps = (primitive.entry("attributes"), *primitive.entries("targets"))
            uses = tuple(tuple((name, m.whole(name)) for name in sorted(m.values)) for m in maps)
            number = primitive.index("material", len(self._looks))
            look = Look() if number is None else self._looks[number]
            packed = "" if primitive.extension(DRACO) is None else primitive.place
            groups.setdefault(_Group(uses, look, packed), []).append(primitive)
        return groups

    def _piece(
        self, group: _Group, primitives: list[Entry], shares: Floats, skinned: bool
    ) -> Piece:
        source = open_source(self._arrays, primitives[0], all_packed=self._all_packed)
        found = [self._triangles(source, primitive) for primitive in primitives]
        triangles, rows = np.concatenate([each for each, _ in found]), None
        if self._users[group.position] > 1:
            # The other vertices are of other pieces.
            rows, places = np.unique(triangles, return_inverse=True)
            triangles = places.reshape(-1, 3)
        vertices, resolution = positions(source, shares, rows)
        joint, weight = joints(source, rows) if skinned else (None, None)
        material = [primitive.index("material", len(self._looks)) for primitive in primitives]
        return Piece(
            vertices,
            triangles,
            np.repeat([-1 if m is None else m for m in material], [len(t) for t, _ in found]),
            resolution,
            texture(source, group.look, shares, rows),
            joint,
            weight,
            sum(stitches for _, stitches in found),
        )

    def _triangles(self, source: Source, primitive: Entry) -> tuple[Ints, int]:
        indices = self._arrays.values(primitive, "indices", "SCALAR")
        if source.faces is not None:
            if primitive.whole("mode", LIST) != LIST:
                primitive.reject("mode", f"{LIST}, the only one that is read of {DRACO}")
            indices = source.faces.reshape(-1, 1)
        elif indices is not None:
            accessor = self._arrays.accessor(primitive, "indices")
            if indices.dtype.kind != "u":
                raise Unreadable(f"{primitive.at('indices')} are not whole numbers from 0 on")
            if accessor is not None and not self._arrays.has_data(accessor):
                raise Unreadable(f"{primitive.at('indices')} are stored nowhere")
        self._arrays.make(primitive, 24 * (source.count if indices is None else len(indices)))
        return make_triangles(primitive, indices, source.count)
