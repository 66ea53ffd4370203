"""Vertices of glTF primitives: positions and texture coordinates, morphed, and joints of skins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.gltf.accessors import Arrays, promised_shape, to_floats
from ffdcli.mesh.io.gltf.compression import decode_draco
from ffdcli.mesh.io.gltf.container import DRACO
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.mesh.io.gltf.materials import Look
from ffdcli.mesh.io.raw_mesh import binary_resolution, text_resolution


@dataclass(frozen=True)
class Source:
    """Where the numbers of a primitive are.

    Parameters
    ----------
    faces : (T, 3) or None
        Triangles, if they are packed with the vertices.
    packed : dict of str to (V, width)
        Attributes that are packed.
    """

    arrays: Arrays
    primitive: Entry
    faces: NDArray[Any] | None
    packed: dict[str, NDArray[Any]]

    @cached_property
    def count(self) -> int:
        """Number of vertices."""
        stored = self.stored("POSITION", "VEC3")
        return 0 if stored is None else len(stored)

    def accessor(self, name: str) -> Entry | None:
        """What the file says of an attribute."""
        return self.arrays.accessor(self.primitive.entry("attributes"), name)

    def stored(self, name: str, *types: str) -> NDArray[Any] | None:
        """(V, width) numbers of an attribute as stored; None if there are none."""
        if name in self.packed:
            return self.packed[name]
        return self.arrays.values(self.primitive.entry("attributes"), name, *types)


def open_source(arrays: Arrays, primitive: Entry, *, all_packed: bool) -> Source:
    """Find and unpack the numbers of a primitive.

    Parameters
    ----------
    all_packed : bool
        Whether the file requires what unpacks them; without, plain numbers are taken.
    """
    attributes = primitive.entry("attributes")
    position = arrays.accessor(attributes, "POSITION")
    draco = primitive.extension(DRACO)
    plain = position is not None and "bufferView" in position
    if draco is not None and (all_packed or not plain):
        faces, packed = decode_draco(draco, arrays.view(draco))
        for name, found in packed.items():
            accessor = arrays.accessor(attributes, name)
            promised = (0, 0) if accessor is None else promised_shape(accessor)
            if found.shape != promised:
                raise Unreadable(
                    f"{draco.place} holds {found.shape} numbers of {name}, "
                    f"but the file promises {promised}"
                )
        return Source(arrays, primitive, faces, packed)
    # Without data positions are 0, which only morph targets make use of.
    if not (plain or (position is not None and "sparse" in position) or "targets" in primitive):
        raise Unreadable(f"{primitive.place} has positions that are stored nowhere")
    return Source(arrays, primitive, None, {})


def positions(source: Source, shares: Floats, rows: Ints | None) -> tuple[Floats, float]:
    """Positions (V, 3), and the smallest distance that their numbers resolve.

    Parameters
    ----------
    shares : (n,) float64
        Of the morph targets; empty for none.
    rows : (V,) int64 or None
        The vertices wanted; None for all.
    """
    stored, accessor = source.stored("POSITION", "VEC3"), source.accessor("POSITION")
    found = _morphed(source, "POSITION", ("VEC3",), shares, rows)
    if stored is None or accessor is None or found is None:
        raise Unreadable(f"{source.primitive.place} has no positions")
    if stored.dtype.kind == "f":
        with np.errstate(over="ignore", invalid="ignore"):
            return found, binary_resolution(found, np.float32)
    step = 1 / np.iinfo(stored.dtype).max if accessor.values.get("normalized") is True else 1.0
    return found, text_resolution(found, 0, step)


def texture(source: Source, look: Look, shares: Floats, rows: Ints | None) -> Floats | None:
    """(V, 2) texture coordinates, v upwards, for the image of a material; None for none."""
    found = _morphed(source, f"TEXCOORD_{look.texture}", ("VEC2",), shares, rows)
    if found is None or look.turned:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        found = found * look.scale + look.offset
    # glTF counts v downwards.
    return np.column_stack([found[:, 0], 1 - found[:, 1]])


def joints(source: Source, rows: Ints | None) -> tuple[Ints, Floats]:
    """Joints (V, J) that move the vertices, and their shares (V, J), as stored."""
    found, shares = [], []
    for number in count():
        joint = source.stored(f"JOINTS_{number}", "VEC4")
        weight = _morphed(source, f"WEIGHTS_{number}", ("VEC4",), np.zeros(0), rows)
        if joint is None or weight is None:
            break
        if joint.dtype.kind != "u":
            raise Unreadable(f"{source.primitive.place}: JOINTS_{number} are not whole numbers")
        found.append((joint if rows is None else joint[rows]).astype(np.int64))
        shares.append(weight)
        if found[-1].shape != weight.shape:
            raise Unreadable(
                f"{source.primitive.place}: JOINTS_{number} and weights differ in number"
            )
    if not found:
        raise Unreadable(
            f"{source.primitive.place} belongs to a skin, but has no joints and weights"
        )
    return np.concatenate(found, axis=1), np.concatenate(shares, axis=1)


def _morphed(
    source: Source, name: str, types: tuple[str, ...], shares: Floats, rows: Ints | None
) -> Floats | None:
    """Numbers of an attribute, moved by the targets' shares (3.7.2.2 of the standard)."""
    stored, accessor = source.stored(name, *types), source.accessor(name)
    if stored is None or accessor is None:
        return None
    if len(stored) != source.count:
        raise Unreadable(
            f"{source.primitive.place}: {name} has {len(stored)} entries, not {source.count}"
        )
    targets = source.primitive.entries("targets")
    if len(shares) not in (0, len(targets)):
        raise Unreadable(
            f"{source.primitive.place} has {len(targets)} targets, but {len(shares)} weights"
        )
    found = _chosen(source, stored, accessor, rows)
    for target, share in zip(targets, shares.tolist(), strict=False):
        moved = source.arrays.values(target, name, *types) if share else None
        other = source.arrays.accessor(target, name)
        if moved is None or other is None:
            continue
        if len(moved) != source.count:
            raise Unreadable(f"{target.at(name)} has {len(moved)} entries, not {source.count}")
        with np.errstate(over="ignore", invalid="ignore"):
            found = found + share * _chosen(source, moved, other, rows)
    return found


def _chosen(source: Source, stored: NDArray[Any], accessor: Entry, rows: Ints | None) -> Floats:
    chosen = stored if rows is None else stored[rows]
    source.arrays.make(accessor, 8 * chosen.size)
    return to_floats(chosen, accessor)
