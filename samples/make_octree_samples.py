"""Make the mesh of `samples/octree`: a small tree, trunk and branches grown into one surface.

Like those of `make_samples.py`, from arithmetic alone; the files kept are what it writes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from make_samples import cone_distance, surface_net, write_ply

Floats = Any

# Start, end and the radii there, mm: trunk, then branches and twigs.
RODS = [
    ((0, 0, 0), (2, 1, 45), 12.6, 9.1),
    ((2, 1, 45), (-3, -2, 92), 9.1, 5.9),
    ((2, 1, 40), (34, 6, 66), 7.3, 5.9),
    ((34, 6, 66), (46, 18, 88), 5.9, 5.3),
    ((34, 6, 66), (56, -10, 70), 5.6, 5.3),
    ((0, 0, 55), (-30, 12, 78), 6.7, 5.6),
    ((-30, 12, 78), (-48, 8, 98), 5.6, 5.3),
    ((0, 0, 62), (-8, -32, 84), 6.4, 5.3),
    ((-3, -2, 92), (12, 10, 114), 5.6, 5.3),
    ((-3, -2, 92), (-18, -12, 112), 5.6, 5.3),
    ((0, 0, 0), (16, 10, -4), 7.7, 5.9),
    ((0, 0, 0), (-14, 12, -4), 7.7, 5.9),
    ((0, 0, 0), (2, -18, -4), 7.7, 5.9),
]


def tree(points: Floats) -> Floats:
    """Distance to the surface, about: negative inside; rods flow into one another."""
    distances = np.stack([cone_distance(points, *rod) for rod in RODS])
    blend = 1.5
    nearest = distances.min(axis=0)
    return nearest - blend * np.log(np.exp((nearest - distances) / blend).sum(axis=0))


def main(folder: Path) -> None:
    """Write the mesh."""
    low, high = np.array([-66.0, -52.0, -20.0]), np.array([76.0, 40.0, 132.0])
    write_ply(folder / "tree.ply", "Tree", *surface_net(tree, low, high, 5.0))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "octree")
