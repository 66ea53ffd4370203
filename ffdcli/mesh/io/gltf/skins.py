"""Skins of a glTF file: vertices moved by their joints (3.7.3 of the standard)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.mesh.io.gltf.accessors import Arrays, to_floats
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.mesh.io.gltf.meshes import Piece
from ffdcli.mesh.io.gltf.nodes import Nodes, require_affine
from ffdcli.mesh.io.raw_mesh import binary_resolution

# Shares of whole bytes need not add up to 1; what is further off is said.
_NOISE = 0.01


@dataclass(frozen=True)
class Skinned:
    """A piece in world coordinates.

    Parameters
    ----------
    mirrored : bool
        Whether all its joints turn it inside out.
    uneven : int
        Vertices whose shares do not add up to 1; they were divided by their sum.
    """

    vertices: Floats
    resolution: float
    mirrored: bool
    uneven: int


def joint_matrices(skin: Entry, nodes: Nodes, arrays: Arrays) -> Floats:
    """(J, 4, 4) from the coordinates of a skinned mesh to the world's, by each joint."""
    numbers = skin.indices("joints", len(nodes.entries))
    stored = arrays.values(skin, "inverseBindMatrices", "MAT4")
    accessor = arrays.accessor(skin, "inverseBindMatrices")
    if not numbers:
        raise Unreadable(f"{skin.place} has no joints")
    if stored is None or accessor is None:
        return nodes.world[numbers]
    if len(stored) < len(numbers):
        raise Unreadable(f"{skin.place} has {len(numbers)} joints, but {len(stored)} matrices")
    rest = to_floats(stored[: len(numbers)], accessor).reshape(-1, 4, 4).swapaxes(1, 2)
    if not np.isfinite(rest).all():
        raise Unreadable(f"{skin.at('inverseBindMatrices')} are not finite")
    with np.errstate(over="ignore", invalid="ignore"):
        found = nodes.world[numbers] @ require_affine(skin.at("inverseBindMatrices"), rest)
    if not np.isfinite(found).all():
        raise Unreadable(f"the joints of {skin.place} have places that are not finite")
    return found


def apply_skin(skin: Entry, piece: Piece, matrices: Floats, arrays: Arrays) -> Skinned:
    """Move the vertices of a piece by the joints of a skin.

    Raises
    ------
    Unreadable
        A joint that does not exist, or shares that are none.
    """
    if piece.joints is None or piece.weights is None:
        raise Unreadable(f"{skin.place} moves a mesh without joints")
    weights = piece.weights
    if not (np.isfinite(weights) & (weights >= 0)).all():
        raise Unreadable(f"a vertex moved by {skin.place} has a weight that is no share")
    used: Bools = weights > 0
    if (piece.joints[used] >= len(matrices)).any():
        raise Unreadable(
            f"a vertex is moved by joint {piece.joints[used].max()} of {skin.place} "
            f"(counted from 0), which has {len(matrices)}"
        )
    total = weights.sum(axis=1)
    if (total == 0).any():
        raise Unreadable(f"a vertex moved by {skin.place} has no weights")
    arrays.make(skin, 2 * 24 * len(piece.vertices))
    vertices = np.zeros((len(piece.vertices), 3))
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z = piece.vertices.T[:, :, None]
        for joint, weight in zip(np.where(used, piece.joints, 0).T, weights.T, strict=True):
            m = matrices[joint]
            moved = x * m[:, :3, 0] + y * m[:, :3, 1] + z * m[:, :3, 2] + m[:, :3, 3]
            vertices += np.where(weight[:, None] > 0, (weight / total)[:, None] * moved, 0)
        acting = matrices[np.unique(piece.joints[used])]
        stretch = float(np.linalg.norm(acting[:, :3, :3], 2, axis=(1, 2)).max(initial=0.0))
        sign = np.linalg.slogdet(acting[:, :3, :3])[0]
    return Skinned(
        vertices,
        max(piece.resolution * stretch, binary_resolution(vertices, np.float64)),
        bool(len(acting)) and bool((sign < 0).all()),
        int(np.count_nonzero(np.abs(total - 1) > _NOISE)),
    )
