"""Octrees and adaptive volumes for the tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from ffdcli.volume.adaptive.hierarchical import hierarchical_volume
from ffdcli.volume.adaptive.octree import ModelTree
from ffdcli.volume.adaptive.octree_growth import Region, grow
from ffdcli.volume.adaptive.tspline import tspline_volume
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame

Floats = Any

FRAME = Frame(np.zeros(3), np.eye(3))
BOX = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
CORNER = Region(np.zeros(3), np.full(3, 0.2), 4)


def ball(radius: float = 0.3) -> Floats:
    """Triangles of a ball in the middle of the unit cube."""
    mesh = trimesh.creation.icosphere(2, radius)
    return np.asarray(mesh.vertices[mesh.faces]) + 0.5


def tree_with_junctions() -> ModelTree:
    """A small ball, and one corner finer: cells of three sizes."""
    return grow(ball(0.1), None, 3, [CORNER])


def regular_tree(depth: int) -> ModelTree:
    """All cells alike."""
    return grow(None, None, 0, [Region(np.zeros(3), np.ones(3), depth)])


def shaken(volume: AdaptiveVolume, *, weights: bool = False, seed: int = 0) -> AdaptiveVolume:
    """Control points moved a little, and weights too if asked."""
    random = np.random.default_rng(seed)
    points = volume.rest_points + 0.05 * random.uniform(-1, 1, volume.rest_points.shape)
    factors = random.uniform(0.5, 2, volume.shape) if weights else 1.0
    return volume.with_control(points, volume.rest_weights * factors)


def all_kinds() -> dict[str, AdaptiveVolume]:
    """One of each kind, edited."""
    model = tree_with_junctions()
    spline = tspline_volume(model, BOX, (100.0, 1.0), FRAME)
    return {
        "tspline": shaken(spline),
        "weights": shaken(spline, weights=True),
        "cubic": shaken(hierarchical_volume(model.tree, BOX, (3, 3, 3), FRAME)),
        "mixed": shaken(hierarchical_volume(model.tree, BOX, (2, 1, 4), FRAME)),
    }


def places(count: int, seed: int = 1) -> Floats:
    """Points of the box."""
    return np.random.default_rng(seed).uniform(BOX[0], BOX[1], (count, 3))
