"""Nodes of a glTF file: what the scene places, and where (3.5 of the standard)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.mesh.io.gltf.accessors import Arrays, to_floats
from ffdcli.mesh.io.gltf.container import INSTANCING
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable

# Noise of a matrix's last row, which is 0, 0, 0, 1.
_NOISE = 1e-6


@dataclass(frozen=True)
class Nodes:
    """The nodes of a file.

    Parameters
    ----------
    entries : list of Entry
    world : (n, 4, 4) float64
        From coordinates of each node to those of the world.
    scene : Entry
        The scene that is read; empty if the file has none.
    shown : list of int
        Its nodes, parents first; all nodes if the file has no scene.
    """

    entries: Sequence[Entry]
    world: Floats
    scene: Entry
    shown: Sequence[int]


def read_nodes(root: Entry) -> Nodes:
    """Places of all nodes, and the nodes of the scene that the file names, else of its first.

    Raises
    ------
    Unreadable
        Nodes are their own ancestors, have two parents, or a place that is none.
    """
    entries = root.entries("nodes")
    children = [each.indices("children", len(entries)) for each in entries]
    parent = [-1] * len(entries)
    for number, below in enumerate(children):
        for child in below:
            if parent[child] >= 0:
                raise Unreadable(
                    f"nodes[{child}] is below nodes[{parent[child]}] and below nodes[{number}]"
                )
            parent[child] = number
    order = _descend([n for n, above in enumerate(parent) if above < 0], children)
    if len(order) < len(entries):
        lost = min(set(range(len(entries))) - set(order))
        raise Unreadable(f"nodes[{lost}] is below itself")
    world = _local(entries)
    with np.errstate(over="ignore", invalid="ignore"):
        for number in order:
            if parent[number] >= 0:
                world[number] = world[parent[number]] @ world[number]
    scenes, scene = root.entries("scenes"), Entry({})
    if scenes:
        scene = scenes[root.index("scene", len(scenes)) or 0]
        tops = scene.indices("nodes", len(entries))
        for top in tops:
            if parent[top] >= 0:
                raise Unreadable(f"nodes[{top}] is in {scene.place} and below nodes[{parent[top]}]")
        if len(set(tops)) < len(tops):
            raise Unreadable(f"{scene.at('nodes')} names a node twice")
    else:
        tops = [n for n, above in enumerate(parent) if above < 0]
    return Nodes(entries, world, scene, _descend(tops, children))


def place_copies(node: Entry, world: Floats, arrays: Arrays) -> Floats:
    """(n, 4, 4) places of the copies of a node's mesh: one, or those of `INSTANCING`."""
    stated = node.extension(INSTANCING)
    if stated is None:
        return world[None]
    attributes = stated.entry("attributes")
    found: dict[str, Floats] = {}
    for name, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")):
        stored, accessor = arrays.values(attributes, name, kind), arrays.accessor(attributes, name)
        if stored is not None and accessor is not None:
            found[name] = to_floats(stored, accessor)
    counts = {len(each) for each in found.values()}
    if len(counts) != 1:
        raise Unreadable(f"{stated.place} has attributes of {sorted(counts)} copies")
    count = counts.pop()
    arrays.make(stated, 4 * 16 * 8 * count)
    move = found.get("TRANSLATION", np.zeros((count, 3)))
    turn = found.get("ROTATION", np.tile([0.0, 0, 0, 1], (count, 1)))
    scale = found.get("SCALE", np.ones((count, 3)))
    with np.errstate(over="ignore", invalid="ignore"):
        return world @ _compose([stated.place] * count, move, turn, scale)


def _descend(tops: list[int], children: list[list[int]]) -> list[int]:
    """The nodes below some and these, parents first; one below itself is left out."""
    order: list[int] = []
    waiting = tops[::-1]
    while waiting:
        number = waiting.pop()
        order.append(number)
        waiting.extend(reversed(children[number]))
    return order


def _local(nodes: Sequence[Entry]) -> Floats:
    """(n, 4, 4) place of each node in its parent."""
    defaults = (("translation", [0.0, 0, 0]), ("rotation", [0.0, 0, 0, 1]), ("scale", [1.0, 1, 1]))
    stated = [[node.numbers(key, len(default)) for node in nodes] for key, default in defaults]
    parts = [
        np.array([default if given is None else given for given in column]).reshape(
            -1, len(default)
        )
        for column, (_, default) in zip(stated, defaults, strict=True)
    ]
    found = _compose([node.place for node in nodes], *parts)
    for number, node in enumerate(nodes):
        matrix = node.numbers("matrix", 16)
        if matrix is None:
            continue
        if any(column[number] is not None for column in stated):
            raise Unreadable(f"{node.place} has both a matrix and a translation, rotation or scale")
        found[number] = require_affine(node.at("matrix"), matrix.reshape(1, 4, 4).swapaxes(1, 2))[0]
    return found


def require_affine(place: str, matrices: Floats) -> Floats:
    """The matrices (n, 4, 4), if their last rows are 0, 0, 0, 1."""
    off = ~(np.abs(matrices[:, 3] - [0, 0, 0, 1]) <= _NOISE).all(axis=1)
    if off.any():
        raise Unreadable(f"{place} is not the matrix of a place: its last row is not 0, 0, 0, 1")
    found = matrices.copy()
    found[:, 3] = [0, 0, 0, 1]
    return found


def _compose(places: list[str], move: Floats, turn: Floats, scale: Floats) -> Floats:
    """(n, 4, 4) scale, then rotation by quaternions (x, y, z, w), then translation."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        x, y, z, w = turn.T * np.sqrt(2 / np.einsum("ij,ij->i", turn, turn))
        out = np.zeros((len(move), 4, 4))
        out[:, 0, :3] = np.stack([1 - y * y - z * z, x * y - z * w, x * z + y * w], axis=1)
        out[:, 1, :3] = np.stack([x * y + z * w, 1 - x * x - z * z, y * z - x * w], axis=1)
        out[:, 2, :3] = np.stack([x * z - y * w, y * z + x * w, 1 - x * x - y * y], axis=1)
        out[:, :3, :3] *= scale[:, None, :]
    out[:, :3, 3], out[:, 3, 3] = move, 1
    wrong = np.flatnonzero(~np.isfinite(out).all(axis=(1, 2)))
    if len(wrong):
        raise Unreadable(
            f"{places[wrong[0]]} has a place that is not finite, or a rotation of length 0"
        )
    return out
