"""Make the samples of fields again: `python samples/make_field_samples.py [FOLDER]`.

A result as a program of finite elements writes it: nodes and triangles on the surface of the
bracket, and how far a load on its seat moves them. The numbers come from the formula of a
cantilever, with sections that turn: the plate at the wall stays, the tip sinks by 5 mm.

A scan as a scanner gives it: points on the sunken bracket, with noise, and none on the wall's side.

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
# Points of the scan, their noise, and how near to the wall there are none.
POINTS, NOISE, HIDDEN = 4000, 0.03, 1.0


def sag(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 3) of points (n, 3)."""
    x, z = np.maximum(points[:, 0] - ROOT, 0), points[:, 2]
    height = -TIP * (3 * LENGTH * x**2 - x**3) / (2 * LENGTH**3)
    slope = -TIP * (6 * LENGTH * x - 3 * x**2) / (2 * LENGTH**3)
    return np.stack([-z * slope, np.zeros(len(x)), height], axis=1)


def scan(corners: NDArray[np.float64]) -> NDArray[np.float32]:
    """Points on triangles (t, 3, 3), evenly spread, sunken, with noise."""
    random = np.random.default_rng(19)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(sides, axis=1)
    triangle = random.choice(len(corners), POINTS, p=area / area.sum())
    shares = random.dirichlet([1, 1, 1], POINTS)
    points = np.einsum("pc,pcx->px", shares, corners[triangle])
    points = points[points[:, 0] > HIDDEN]
    return (points + sag(points) + random.normal(0, NOISE, points.shape)).astype(np.float32)


def main(folder: Path) -> None:
    """Write the result as VTU, and the scan as PLY."""
    part = cq.importers.importStep(str(CAD)).val()
    nodes, triangles = part.tessellate(0.1, 0.3)
    points = np.array([node.toTuple() for node in nodes])
    # Faces share the nodes of their edges.
    points, number = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    cells = number.reshape(-1)[np.array(triangles)]
    result = {"displacement": sag(points)}
    (folder / "fields").mkdir(exist_ok=True)
    mesh = meshio.Mesh(points, [("triangle", cells)], point_data=result)
    mesh.write(folder / "fields" / "bracket.vtu")
    nodes, triangles = part.tessellate(0.01, 0.03)
    found = scan(np.array([node.toTuple() for node in nodes])[np.array(triangles)])
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(found)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    content = head.encode() + found.astype("<f4").tobytes()
    (folder / "fields" / "bracket_scan.ply").write_bytes(content)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
