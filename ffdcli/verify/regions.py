"""Lattices of one file, each judged by its own bound: fitted ones by their fits, others exact."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ffdcli.brep.evaluate.closedness import describe
from ffdcli.brep.evaluate.face_points import distances, edge_points, face_points
from ffdcli.brep.evaluate.lookup import model_of_read
from ffdcli.brep.evaluate.trim import outlines
from ffdcli.brep.readback import ReadBrep
from ffdcli.deformation import Deformation
from ffdcli.mesh import Mesh, triangles
from ffdcli.verify.compare import settling_distance
from ffdcli.verify.deformed_mesh import DeformedMesh, spread_over

# Deviation allowed where nothing was reduced or fitted, as a share of the mesh's size.
_EXACT = 1e-9


def too_far_by_region(
    read: ReadBrep,
    mesh: Mesh,
    deformation: Deformation,
    tolerance: float,
    bounds: Mapping[int, float],
    samples: int,
) -> list[str]:
    """Messages for points of the deformed mesh that are farther off than their lattice allows.

    Parameters
    ----------
    read : ReadBrep
        Content of the file.
    mesh : Mesh
    deformation : Deformation
    tolerance : float, model length
        Deviation allowed where the fit is worst.
    bounds : mapping of int to float, model length
        Bound of the fit of each fitted lattice, by its number. Other lattices, and what lies
        outside all boxes, have a bound of 0.
    samples : int
        Points spread over the mesh, in addition to those of each triangle.
    """
    corners, _ = triangles(mesh)
    neighbours = np.full(corners.shape, -1)
    image = DeformedMesh(mesh.vertices[corners], neighbours, deformation)
    triangle, params = spread_over(image, samples)
    rest = image.at(triangle, params)
    box = deformation.boxes_of(rest)
    model = model_of_read(read)
    lines = outlines(model)
    spots, on_edges = face_points(model, lines, samples), edge_points(model)
    settle = settling_distance(mesh.size, float(np.abs(read.points).max(initial=0.0)))
    worst = max(bounds.values())
    messages = []
    for number in np.unique(box).tolist():
        bound = bounds.get(number, 0.0)
        points = deformation.images(rest[box == number])
        allowed = max(tolerance - worst + bound, _EXACT * mesh.size)
        if allowed >= tolerance:
            continue
        hints = np.full(len(points), -1)
        feet = distances(
            model, lines, spots, on_edges, points, hints, settle, 1e-3 * allowed, allowed
        )
        far = (feet.distance > allowed) & (feet.least >= allowed)
        if far.any():
            first = int(np.argmax(np.where(far, feet.distance, 0)))
            where = "outside the boxes" if number < 0 else f"in the box of lattices[{number}]"
            messages.append(
                f"{far.sum()} of {len(far)} points of the deformed mesh {where} are not on the "
                f"file's faces within the {allowed:.3g} allowed there, the worst at "
                f"{describe(points[first])}, {feet.distance[first]:.3g} away"
            )
    return messages


def fit_bounds(report: Mapping[str, object]) -> dict[int, float]:
    """Bounds of the fits that a report of ``ffd deform`` states, by number of the lattice."""
    fit = report.get("fit")
    entries = fit.get("lattices", ()) if isinstance(fit, Mapping) else ()
    return {each["lattice"]: each["bound"] for each in entries}
