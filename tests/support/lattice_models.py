"""Lattices settled by a box, made from the keys of a lattice file."""

import numpy as np

from ffdcli.lattice import parse_lattice
from ffdcli.lattice.file.source import Source

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([3.0, 2.0, 6.0])
FAR, DOWN = np.array([1e6, -2e6, 3e5]), np.array([0, 0, 1])
SMALLER = {"box": {"min": [0, 0, 3], "max": [3, 2, 6]}}


def box_triangles(low, high):
    """Triangles of an axis-aligned box."""
    i = np.array(
        [
            *([0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]),
            *([2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]),
        ]
    )
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    return (np.asarray(low) + corners * (np.asarray(high) - low))[i]


def lattice_of(**keys):
    return parse_lattice({"version": 1, **keys}, Source("l.yaml"))


def settled(low=LOW, high=HIGH, delta=1e-9, **keys):
    return lattice_of(**keys).settle(
        bounds=np.array([low, high]), triangles=box_triangles(low, high), delta=delta
    )
