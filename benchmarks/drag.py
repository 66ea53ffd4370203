"""How fast a drag is: `python benchmarks/drag.py [--constraints 100] [--per-axis 22]`.

Compares ``lattice.drag`` with the dense pseudo-inverse of Hsu et al. (1992) in the same run: cubic,
10,000 control points, 100 constraints by default.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from ffdcli.lattice import Lattice, parse_lattice
from ffdcli.lattice.file.source import Source


def make_lattice(per_axis: int) -> Lattice:
    """A cubic lattice over the unit cube with ``per_axis`` control points along each axis."""
    keys = {"version": 1, "points": [per_axis] * 3, "box": {"min": [0, 0, 0], "max": [1, 1, 1]}}
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 1]]], dtype=float)
    return parse_lattice(keys, Source()).settle(
        bounds=np.array([[0, 0, 0], [1, 1, 1]], dtype=float), triangles=corners, delta=1e-9
    )


def best_time(call: Callable[[], object], repeats: int) -> float:
    """Shortest of several runs, in seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def compare(constraints: int, per_axis: int) -> dict[str, float]:
    """Seconds of both ways, their ratio, and the largest difference of the control points."""
    rng = np.random.default_rng(20010725)
    lattice = make_lattice(per_axis)
    sources = rng.uniform(size=(constraints, 3))
    targets = sources + 0.05 * rng.normal(size=sources.shape)
    matrix = lattice.volume.basis_matrix(sources).toarray()

    def dense() -> np.ndarray:
        return lattice.points + (np.linalg.pinv(matrix) @ (targets - sources)).reshape(
            lattice.points.shape
        )

    quick = best_time(lambda: lattice.drag(sources, targets), 20)
    slow = best_time(dense, 2)
    difference = np.abs(lattice.drag(sources, targets).points - dense()).max()
    return {"drag": quick, "dense": slow, "ratio": slow / quick, "difference": float(difference)}


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--constraints", type=int, default=100)
    parser.add_argument("--per-axis", type=int, default=22)
    options = parser.parse_args()
    found = compare(options.constraints, options.per_axis)
    print(f"{options.per_axis**3} control points, {options.constraints} constraints, cubic")
    print(f"lattice.drag          {1e3 * found['drag']:10.2f} ms")
    print(f"dense pseudo-inverse  {1e3 * found['dense']:10.2f} ms")
    print(f"ratio                 {found['ratio']:10.0f}")
    print(f"largest difference    {found['difference']:10.1e}")


if __name__ == "__main__":
    main()
