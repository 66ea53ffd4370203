"""Make the sample of a field again: `python samples/make_field_samples.py [FOLDER]`.

A result as a program of finite elements writes it: nodes and triangles on the surface of the
bracket, and how far a load on its seat moves them. The numbers come from the formula of a
cantilever, with sections that turn: the plate at the wall stays, the tip sinks by 5 mm.

Needs `python -m pip install 'ffdcli[fields]'`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq
import meshio
import numpy as np
from numpy.typing import NDArray

CAD = Path(__file__).parent / "cad" / "bracket.step"
# Where the arm leaves the plate, its length from there, and how far its end sinks.
ROOT, LENGTH, TIP = 10.0, 114.0, 5.0


def sag(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 3) of points (n, 3)."""
    x, z = np.maximum(points[:, 0] - ROOT, 0), points[:, 2]
    height = -TIP * (3 * LENGTH * x**2 - x**3) / (2 * LENGTH**3)
    slope = -TIP * (6 * LENGTH * x - 3 * x**2) / (2 * LENGTH**3)
    return np.stack([-z * slope, np.zeros(len(x)), height], axis=1)


def main(folder: Path) -> None:
    """Write the result as VTU."""
    nodes, triangles = cq.importers.importStep(str(CAD)).val().tessellate(0.1, 0.3)
    points = np.array([node.toTuple() for node in nodes])
    # Faces share the nodes of their edges.
    points, number = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    cells = number.reshape(-1)[np.array(triangles)]
    result = {"displacement": sag(points)}
    (folder / "fields").mkdir(exist_ok=True)
    mesh = meshio.Mesh(points, [("triangle", cells)], point_data=result)
    mesh.write(folder / "fields" / "bracket.vtu")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
