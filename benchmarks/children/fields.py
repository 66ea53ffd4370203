"""A field at many points, met by a lattice that a fit divides, or by scipy's radial functions.

Arguments: way (`fit` or a number of neighbours), number of pairs, noise, tolerance. Prints the
error at other points inside the box, and what was used.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np

CUBE = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
OTHERS = 20_000


def field(places: np.ndarray) -> np.ndarray:
    """Waves all over the box, and a dent."""
    x, y, z = places.T
    waves = [np.sin(6 * x) * np.cos(3 * y), np.cos(4 * z + x), np.sin(2 * x * y + 3 * z)]
    dent = np.exp(-((places - [0.3, 0.4, 0.5]) ** 2).sum(axis=1) / (2 * 0.05**2))
    return 0.1 * np.stack(waves, axis=1) + dent[:, None] * [0, 0, 0.05]


def fitted(places: np.ndarray, moves: np.ndarray, tolerance: float, others: np.ndarray) -> Any:
    """Displacements of other points by a fit, and what it reached."""
    from ffdcli.lattice import parse_lattice
    from ffdcli.lattice.file.definition import PairTable
    from ffdcli.lattice.file.source import Source

    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    fit = {"fit": {"pairs": [{"from": [0, 0, 0], "by": [0, 0, 0]}], "tolerance": tolerance}}
    octree = {"depth": "auto"}
    keys = {"version": 1, "volume": "hierarchical", "octree": octree, "edits": [fit]}
    file = parse_lattice(keys, Source())
    by = np.ones(len(places), dtype=bool)
    pairs = {0: PairTable(places, moves, by, np.ones(len(places)))}
    file = replace(file, definitions=(replace(file.definitions[0], pairs=pairs),))
    lattice = file.settle(bounds=CUBE, triangles=corners[[[0, 1, 2], [5, 6, 7]]], delta=1e-9)
    frame = lattice.maps[0].frame
    found = frame.to_model(lattice.maps[0].evaluate(frame.to_local(others))) - others
    return found, lattice.fits[0].as_report()


def main(way: str, count: int, noise: float, tolerance: float) -> None:
    """Print the error as JSON."""
    rng = np.random.default_rng(5)
    places, others = rng.random((count, 3)), 0.02 + 0.96 * rng.random((OTHERS, 3))
    moves = field(places) + noise * rng.standard_normal((count, 3))
    facts: dict[str, Any] = {}
    if way == "fit":
        found, facts = fitted(places, moves, tolerance, others)
    else:
        from scipy.interpolate import RBFInterpolator

        smoothing = 0.0 if noise == 0 else 1e-2
        found = RBFInterpolator(places, moves, neighbors=int(way), smoothing=smoothing)(others)
    error = np.linalg.norm(found - field(others), axis=1)
    facts["error"] = float(np.sqrt(np.mean(error**2)))
    facts["worst"] = float(error.max())
    print(json.dumps(facts))


main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]))
